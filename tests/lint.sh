#!/usr/bin/env bash
# Format, lints and documentation of all crates. Exit 77 where rustup's components rustfmt and clippy are missing.
set -euo pipefail
cd "$(dirname "$0")/.."
. tests/lib.sh

cargo fmt --version >/dev/null 2>&1 && cargo clippy --version >/dev/null 2>&1 ||
  give_up "rustfmt or clippy is missing (rustup component add rustfmt clippy)"
prepare_only "$@"

cargo fmt --all --check
# Of the same profile as the tests, whose build scripts and macros it shares.
cargo clippy --profile "$profile" --workspace --all-targets --locked -- -D warnings
RUSTDOCFLAGS="-D warnings" cargo doc --profile "$profile" --workspace --no-deps --locked --quiet
echo "format, lints and documentation: no remarks"
