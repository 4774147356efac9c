#!/usr/bin/env bash
# packaging/release.sh --dry-run [--only PART]: makes what a release consists of, into dist/, with checksums. Publishes nothing.
# PART is one of
#   sdist    the Python package as source
#   wheel    the Python package for this kind of processor, built from this source
#   deb      the command for Debian and Ubuntu, for this kind of processor
#   aarch64  both for 64-bit ARM, cross-built (needs rustup)
#   source   the repository with all crates that it needs: builds without a network
#   rosdebian  folders debian/ for ROS 2 humble and jazzy, to be laid over that source
#   crates   the crates as crates.io would get them; they are checked, and stay in target/package
#   semver   whether the crates' interfaces keep what those of the last tag promised (cargo-semver-checks)
#   sbom     what is in the command: a list of all crates in CycloneDX
#   plan     which archives and installers cargo-dist would make of a tag (dist-workspace.toml); it makes none of them
#
# All programs are linked by zig (from PyPI) against glibc 2.28: they run on Debian 10, Ubuntu 20.04, RHEL 8 and newer, wherever they are
# built.
set -euo pipefail
cd "$(dirname "$0")/.."
. tests/lib.sh
target=$(uname -m)-unknown-linux-gnu

parts=(sdist wheel deb aarch64 source rosdebian crates semver sbom plan)
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

# tool NAME VERSION: a subcommand of cargo, built once into target/tools; unoptimised, since it is quick enough.
tool() {
  [ -x "target/tools/bin/cargo-$1" ] || cargo install --quiet --locked --debug --root target/tools "cargo-$1@$2" ||
    give_up "cargo-$1 cannot be installed from crates.io"
  export PATH=$PWD/target/tools/bin:$PATH
}

# What links programs for an old glibc, from PyPI.
zig() {
  environment "$PWD/target/release-tools" "maturin>=1.16,<2" ziglang==0.17.1 cargo-zigbuild==0.24.1
  export PATH=$PWD/target/release-tools/bin:$PATH
}

# wheel_of TARGET: the package for this kind of machine, built in a folder that has the source distribution and nothing else.
wheel_of() {
  local bytes name=roscausal-$version
  [ -e "dist/$name.tar.gz" ] || sdist
  rm -rf target/sdist && mkdir -p target/sdist && tar -xz -C target/sdist -f "dist/$name.tar.gz"
  zig
  CARGO_TARGET_DIR=${CARGO_TARGET_DIR:-$PWD/target} maturin build --quiet --profile wheel --locked --manifest-path "target/sdist/$name/roscausal_py/Cargo.toml" \
    --target "$1" --zig --compatibility manylinux_2_28 --compression-level 9 --out dist
  bytes=$(stat -c %s "$(ls -t dist/roscausal-*.whl | head -1)")
  [ "$bytes" -le 10000000 ] || broken "the wheel has $bytes bytes; nobody waits for more than 10 MB"
}

wheel() { wheel_of $target; }

# Cross-built; the standard library for it comes from rustup.
aarch64() {
  rustup target add aarch64-unknown-linux-gnu >/dev/null 2>&1 || give_up "rustup cannot add aarch64-unknown-linux-gnu"
  wheel_of aarch64-unknown-linux-gnu
  deb_of aarch64-unknown-linux-gnu
}

# maturin leaves out what the package does not need, but not the line that takes rustdds from third_party/, where then is none; and
# the lock file becomes that of the crates that are there.
sdist() {
  local made name=roscausal-$version
  made=$(mktemp -d)
  zig
  maturin sdist --manifest-path roscausal_py/Cargo.toml --out "$made"
  tar -xz -C "$made" -f "$made/$name.tar.gz"
  sed -i '/^# With four changes; third_party/d; /^\[patch.crates-io\]/,/^$/d' "$made/$name/Cargo.toml"
  (cd "$made/$name" && cargo metadata --quiet --format-version 1 --manifest-path roscausal_py/Cargo.toml >/dev/null) ||
    broken "the Python package's source is not whole"
  archive "$made" "$name" | gzip -9n >"dist/$name.tar.gz"
  rm -rf "$made"
}

# archive FOLDER NAME: FOLDER/NAME as a tar file without a trace of this machine.
archive() { tar --sort=name --mtime="@$SOURCE_DATE_EPOCH" --owner=0 --group=0 --numeric-owner -C "$1" -c "$2"; }

# The command with the list of its crates inside (`cargo audit bin` reads it), and with Parquet and Arrow (tests/recordings.sh tests
# them): who installs a package cannot build a feature.
audited() {
  cargo auditable zigbuild --quiet --release --locked -p roscausal --features columnar --bin roscausal --target "$1.2.28"
}

# deb_of TARGET: the package for this kind of machine. What its program would write of itself, this machine's program writes.
deb_of() {
  zig
  tool auditable 0.7.7
  tool deb 3.8.0
  audited "$1"
  local made=target/package program=${CARGO_TARGET_DIR:-target}/$target/release/roscausal
  [ "$1" = "$target" ] || audited "$target"
  rm -rf $made/man $made/completions
  mkdir -p $made/completions
  "$program" man $made/man
  gzip -9n $made/man/*.1
  "$program" completions bash >$made/completions/roscausal.bash
  "$program" completions zsh >$made/completions/_roscausal
  "$program" completions fish >$made/completions/roscausal.fish
  gzip -9nc CHANGELOG.rst >$made/changelog.gz
  printf 'roscausal (%s-1) unstable; urgency=medium\n\n  * Version %s; changelog.gz says what is new.\n\n -- %s  %s\n' "$version" "$version" \
    "$(sed -n 's/^maintainer = "\(.*\)"/\1/p' Cargo.toml)" "$(date -R -u -d "@$SOURCE_DATE_EPOCH")" >$made/changelog.Debian
  # The system's strip knows this kind of processor alone, the one that comes with Rust knows all.
  local rust
  rust=$(rustc --print sysroot)
  LD_LIBRARY_PATH=$rust/lib "$rust/lib/rustlib/$target/bin/rust-objcopy" --strip-unneeded "${CARGO_TARGET_DIR:-target}/$1/release/roscausal"
  cargo deb --quiet --locked --no-build --no-strip --target "$1" -p roscausal --output dist/
}

deb() { deb_of "$target"; }

# Debian's tools delete files that look like leftovers (dh_clean), so the crates lose theirs, and the word of them.
source_archive() {
  local name=roscausal-$version-vendored made
  made=$(mktemp -d)
  git archive --prefix="$name/" HEAD | tar -x -C "$made"
  cargo vendor --quiet --locked --versioned-dirs "$made/$name/vendor" >/dev/null
  python3 - "$made/$name/vendor" <<'END'
import fnmatch, json, pathlib, sys

for listed in pathlib.Path(sys.argv[1]).glob("*/.cargo-checksum.json"):
    known = json.loads(listed.read_text())
    for file in list(known["files"]):
        if any(fnmatch.fnmatch(pathlib.Path(file).name, form) for form in ("*.orig", "*.rej", "*~", "*.bak", "#*#", "TAGS", ".SUMS")):
            listed.parent.joinpath(file).unlink()
            del known["files"][file]
    listed.write_text(json.dumps(known))
END
  archive "$made" "$name" | xz -T0 -6 >"dist/$name.tar.xz"
  rm -rf "$made"
}

# The folders debian/ of the ROS 2 package, by bloom, without its index on the network: unpacked over the vendored source,
# `dpkg-buildpackage -b` makes ros-DISTRIBUTION-roscausal. cargo comes from rustup, since Ubuntu's is too old.
rosdebian() {
  environment "$PWD/target/bloom" bloom==0.14.4 setuptools==80.9.0
  local made release distribution system dependencies
  made=$(mktemp -d)
  dependencies=$(sed -n '/condition="$ROS_VERSION != 2"/d; s/.*_\?depend[^>]*>\([a-z0-9_]*\)<.*/\1/p' package.xml | sort -u)
  for release in humble:jammy jazzy:noble; do
    distribution=${release%:*} system=${release#*:}
    mkdir -p "$made/$distribution"/{sources,package}
    printf '%%YAML 1.1\n---\ndistributions:\n  %s:\n    distribution: [distribution.yaml]\n    distribution_status: active\n    distribution_type: ros2\n    python_version: 3\ntype: index\nversion: 4\n' \
      "$distribution" >"$made/$distribution/index-v4.yaml"
    printf '%%YAML 1.1\n---\nrelease_platforms:\n  ubuntu: [%s]\nrepositories: {}\ntype: distribution\nversion: 2\n' "$system" >"$made/$distribution/distribution.yaml"
    for dependency in $dependencies; do
      echo "$dependency: {ubuntu: [ros-$distribution-${dependency//_/-}]}"
    done >"$made/$distribution/rosdep.yaml"
    echo "yaml file://$made/$distribution/rosdep.yaml" >"$made/$distribution/sources/10-local.list"
    cp package.xml CHANGELOG.rst "$made/$distribution/package/"
    (
      cd "$made/$distribution/package"
      export ROSDISTRO_INDEX_URL=file://$made/$distribution/index-v4.yaml ROSDEP_SOURCE_PATH=$made/$distribution/sources ROS_HOME=$made/$distribution/home
      export ROS_VERSION=2 ROS_DISTRO=$distribution PATH=$OLDPWD/target/bloom/bin:$PATH
      rosdep update --rosdistro "$distribution" && bloom-generate rosdebian --os-name ubuntu --os-version "$system" --ros-distro "$distribution"
    ) >"$made/log" 2>&1 </dev/null || { tail -20 "$made/log"; broken "bloom does not make the debian folder for $distribution"; }
    archive "$made/$distribution/package" debian | xz -6 >"dist/roscausal-$version-debian-$distribution.tar.xz"
  done
  rm -rf "$made"
}

# The crates that crates.io would get, as `-p NAME`.
published() {
  cargo metadata --quiet --format-version 1 --no-deps | python3 -c 'import json, sys
for package in json.load(sys.stdin)["packages"]:
    if package["publish"] != []: print("-p", package["name"])'
}

# Each is built from what is packed, in the order of their dependencies.
crates() {
  rm -f target/package/*.crate
  # shellcheck disable=SC2046 # the names are words
  cargo package --quiet --locked --allow-dirty $(published)
  ls target/package/*.crate
}

# Before the first tag there is nothing to compare with.
semver() {
  local tag
  tag=$(git describe --tags --abbrev=0 2>/dev/null) || { echo "NOT CHECKED: no tag to compare with"; return 0; }
  tool semver-checks 0.51.0
  # shellcheck disable=SC2046 # the names are words
  cargo semver-checks --baseline-rev "$tag" $(published)
}

sbom() {
  tool cyclonedx 0.5.9
  cargo cyclonedx --quiet --format json --spec-version 1.5 --features columnar --manifest-path Cargo.toml --override-filename roscausal-sbom
  sed "s#file://$PWD#file:///roscausal#g" roscausal-sbom.json >"dist/roscausal-$version-sbom.json"
  find . -name roscausal-sbom.json -not -path './target/*' -delete
}

# cargo-dist from its authors' crate: some minutes, once.
plan() {
  local dist=target/dist-tools/bin/dist
  [ -x "$dist" ] || cargo install --quiet --locked --root target/dist-tools cargo-dist@0.34.0 || give_up "cargo-dist cannot be installed from crates.io"
  "$dist" plan --no-local-paths --output-format=json >target/dist-tools/plan.json || broken "cargo-dist has no plan for dist-workspace.toml"
  mv target/dist-tools/plan.json "dist/roscausal-$version-dist-plan.json"
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
