#!/usr/bin/env bash
# packaging/release.sh --dry-run [--only PART]: makes what a release of the Python package consists of, into dist/: the wheel, the
# source archive, and their checksums. Publishes nothing. PART is wheel or sdist.
#
# With ziglang in the same environment as maturin (`pip install ziglang`) the wheel fits every Linux with glibc 2.28 or newer;
# without it, those with the glibc of this machine.
set -euo pipefail
cd "$(dirname "$0")/.."
. tests/lib.sh

only=
while [ $# -gt 0 ]; do
  case $1 in
    --dry-run) dry=yes ;;
    --only) only=${2:?--only takes wheel or sdist}; shift ;;
    *) echo "usage: packaging/release.sh --dry-run [--only wheel|sdist]" >&2; exit 2 ;;
  esac
  shift
done
[ "${dry:-}" = yes ] || { echo "nothing is published yet: call it with --dry-run" >&2; exit 2; }
wanted() { [ -z "$only" ] || [ "$only" = "$1" ]; }

tools=$PWD/target/python-tools
environment "$tools" "maturin>=1.16,<2"
export PATH=$tools/bin:$PATH
mkdir -p dist
if wanted wheel; then
  zig=()
  "$tools/bin/python" -c 'import ziglang' 2>/dev/null && zig=(--zig --compatibility manylinux_2_28)
  maturin build --quiet --release --locked --manifest-path roscausal_py/Cargo.toml "${zig[@]}" --out dist
fi
if wanted sdist; then
  maturin sdist --manifest-path roscausal_py/Cargo.toml --out dist
fi
# One version everywhere.
version=$(sed -n '/^\[workspace.package\]/,/^\[/s/^version = "\(.*\)"/\1/p' Cargo.toml)
for file in dist/roscausal-*; do
  case $(basename "$file") in
    "roscausal-$version"[-.]*) ;;
    *) broken "$file is not of version $version; empty dist/ first" ;;
  esac
done
(cd dist && sha256sum roscausal-* >SHA256SUMS && cat SHA256SUMS)
