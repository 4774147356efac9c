#!/usr/bin/env bash
# packaging/release.sh --dry-run [--only PART]: makes what a release consists of, into dist/, with checksums. Publishes nothing.
# PART is one of
#   wheel    the Python package for this machine
#   sdist    the Python package as source
#   deb      the command for Debian and Ubuntu
#   source   the repository with all crates that it needs: builds without a network (CMake: -DROSCAUSAL_VENDOR=vendor)
#   crates   the crates as crates.io would get them; they are checked, and stay in target/package
#   sbom     what is in the command: a list of all crates in CycloneDX
#
# With ziglang in the same environment as maturin (`pip install ziglang`) the wheel fits every Linux with glibc 2.28 or newer;
# without it, those with the glibc of this machine.
set -euo pipefail
cd "$(dirname "$0")/.."
. tests/lib.sh
profile=release

parts=(wheel sdist deb source crates sbom)
usage() { echo "usage: packaging/release.sh --dry-run [--only $(IFS='|'; echo "${parts[*]}")]" >&2; exit 2; }
only= dry=
while [ $# -gt 0 ]; do
  case $1 in
    --dry-run) dry=yes ;;
    --only) only=${2-}; [[ " ${parts[*]} " == *" $only "* ]] || usage; shift ;;
    *) usage ;;
  esac
  shift
done
[ "$dry" = yes ] || { echo "nothing is published yet: call it with --dry-run" >&2; exit 2; }

version=$(sed -n '/^\[workspace.package\]/,/^\[/s/^version = "\(.*\)"/\1/p' Cargo.toml)
# Two builds of one commit have the same bytes: its date is theirs, and no folder of this machine is in them.
SOURCE_DATE_EPOCH=$(git log -1 --format=%ct 2>/dev/null || stat -c %Y CHANGELOG.rst)
export SOURCE_DATE_EPOCH
export RUSTFLAGS="--remap-path-prefix=$PWD=/roscausal --remap-path-prefix=${CARGO_HOME:-$HOME/.cargo}=/cargo ${RUSTFLAGS-}"

# tool NAME VERSION: a subcommand of cargo, built once into target/tools.
tool() {
  [ -x "target/tools/bin/cargo-$1" ] || cargo install --quiet --locked --root target/tools "cargo-$1@$2" ||
    give_up "cargo-$1 cannot be installed from crates.io"
  export PATH=$PWD/target/tools/bin:$PATH
}

maturin() {
  local tools=$PWD/target/python-tools
  environment "$tools" "maturin>=1.16,<2"
  PATH=$tools/bin:$PATH "$tools/bin/maturin" "$@"
}

wheel() {
  local zig=()
  target/python-tools/bin/python -c 'import ziglang' 2>/dev/null && zig=(--zig --compatibility manylinux_2_28)
  maturin build --quiet --release --locked --manifest-path roscausal_py/Cargo.toml ${zig[@]+"${zig[@]}"} --out dist
  local bytes
  bytes=$(stat -c %s "$(ls -t dist/roscausal-*.whl | head -1)")
  [ "$bytes" -le 10000000 ] || broken "the wheel has $bytes bytes; nobody waits for more than 10 MB"
}

sdist() { maturin sdist --quiet --manifest-path roscausal_py/Cargo.toml --out dist; }

# The command with the list of its crates inside (`cargo audit bin` reads it), and with Parquet and Arrow: who installs a package
# cannot build a feature. What only it has is tested first.
audited() {
  tool auditable 0.7.7
  cargo test --quiet --release --locked -p roscausal -p roscausal_core --features columnar --test columnar
  cargo auditable build --quiet --release --locked -p roscausal --features columnar --bin roscausal
}

deb() {
  tool deb 3.8.0
  audited
  local made=target/package program
  program=$(program roscausal)
  rm -rf $made/man $made/completions
  mkdir -p $made/completions
  "$program" man $made/man
  gzip -9n $made/man/*.1
  "$program" completions bash >$made/completions/roscausal.bash
  "$program" completions zsh >$made/completions/_roscausal
  "$program" completions fish >$made/completions/roscausal.fish
  gzip -9nc CHANGELOG.rst >$made/changelog.gz
  cargo deb --quiet --locked --no-build -p roscausal --output dist/
}

source_archive() {
  local name=roscausal-$version-vendored made
  made=$(mktemp -d)
  git archive --prefix="$name/" HEAD | tar -x -C "$made"
  cargo vendor --quiet --locked --versioned-dirs "$made/$name/vendor" >/dev/null
  tar --sort=name --mtime="@$SOURCE_DATE_EPOCH" --owner=0 --group=0 --numeric-owner -C "$made" -c "$name" | xz -T0 -6 >"dist/$name.tar.xz"
  rm -rf "$made"
}

crates() { cargo package --quiet --workspace --exclude-lockfile --no-verify --allow-dirty; ls target/package/*.crate; }

sbom() {
  tool cyclonedx 0.5.9
  cargo cyclonedx --quiet --format json --spec-version 1.5 --manifest-path Cargo.toml --override-filename roscausal-sbom
  mv roscausal-sbom.json "dist/roscausal-$version-sbom.json"
  find . -name roscausal-sbom.json -not -path './target/*' -delete
}

# Fails if a file of another version lies in dist/, and writes the checksums.
checksums() {
  local file
  for file in dist/roscausal[-_]*; do
    case $(basename "$file") in
      roscausal[-_]"$version"[-.]*) ;;
      *) broken "$file is not of version $version; empty dist/ first" ;;
    esac
  done
  (cd dist && sha256sum roscausal[-_]* >SHA256SUMS && cat SHA256SUMS)
}

mkdir -p dist
[ -z "$only" ] || parts=("$only")
for part in "${parts[@]}"; do
  echo "== $part"
  case $part in
    source) source_archive ;;
    *) "$part" ;;
  esac
done
checksums
