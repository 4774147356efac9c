#!/usr/bin/env bash
# third_party/rustdds is the published crate with the patches beside it, and differs in nothing else. Exit 77 where cargo cannot
# fetch the crate.
#   tests/rustdds.sh [--renew]        --renew writes the copy anew from the crate and the patches
set -euo pipefail
cd "$(dirname "$0")/.."
. tests/lib.sh
root=$PWD
version=0.15.1 checksum=42683a88b9dc025d7d45771b88d20846443b4901ec4b045ca78b8dd316ab616f

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
# Outside the workspace, which has a rustdds of its own. It fetches the crate alone, and not what that depends on.
(cd "$work" && cargo info --quiet --registry crates-io "rustdds@$version") >/dev/null 2>&1 || true
crate=$(compgen -G "${CARGO_HOME:-$HOME/.cargo}/registry/cache/*/rustdds-$version.crate" | head -1) ||
  give_up "third_party/rustdds is not compared with the crate: cargo cannot fetch rustdds $version"
prepare_only "$@"
echo "$checksum  $crate" | sha256sum --check --quiet || broken "$crate is not rustdds $version as it was published"

tar -xz -C "$work" -f "$crate"
made=$work/rustdds-$version
# A repository of its own, so that git does not look for one above.
git init --quiet "$made"
git -C "$made" apply "$root"/third_party/rustdds.patches/*.patch || broken "the patches do not fit rustdds $version"

# What the copy leaves out: tests, examples and notes, and in Cargo.toml the sections that are for them.
(cd "$made" && rm -rf .[!.]* Cargo.lock Cargo.toml.orig [PRS]*.md examples interop scripts tests ./*.sh src/rtps/*.md)
awk 'BEGIN { RS = ""; ORS = "\n\n" } !/^\[\[(example|test)\]\]|^\[dev-dependencies/' "$made/Cargo.toml" | sed '$d' >"$work/Cargo.toml"
mv "$work/Cargo.toml" "$made/Cargo.toml"
printf '# As its authors have it.\ndisable_all_formatting = true\n' >"$made/rustfmt.toml"

if [ "${1:-}" = --renew ]; then
  rm -rf third_party/rustdds
  cp -r "$made" third_party/rustdds
fi
diff -ru "$made" third_party/rustdds || broken "third_party/rustdds is not rustdds $version with the patches: tests/rustdds.sh --renew makes it so"
echo "third_party/rustdds: the published crate and $(find third_party/rustdds.patches -name '*.patch' | wc -l) patches"
