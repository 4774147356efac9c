#!/usr/bin/env bash
# The live page under load: 100 people, 12 variables, an hour of history. Prints the CPU usage of the server's threads, the memory of the
# browser's page and the frames per second, in Debian's chromium; fails where a figure misses its aim.
# usage: benches/page.sh [PEOPLE [HISTORY_SECONDS]]      (default: 100 3600)
set -euo pipefail
cd "$(dirname "$0")/.."
. tests/lib.sh
tests/browser.sh --prepare
cargo build --quiet --release --workspace --exclude roscausal_py --locked --example page_load
load=target/release/examples/page_load
[ -z "${CARGO_TARGET_DIR:-}" ] || load=$CARGO_TARGET_DIR/release/examples/page_load
exec target/browser-venv/bin/python benches/page.py "$load" "${1:-100}" "${2:-3600}"
