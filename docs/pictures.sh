#!/usr/bin/env bash
# Makes the pictures of README.md anew: docs/pictures.sh [demo|page]; without a word both.
#   demo   docs/demo-dag.svg and docs/run.svg, as `roscausal demo` writes them; tests/demo.rs fails when they are stale
#   page   docs/dashboard.png, a screenshot that tests/browser.sh takes in a real browser
set -euo pipefail
cd "$(dirname "$0")/.."

if [ "${1:-demo}" = demo ]; then
  made=$(mktemp -d)
  trap 'rm -rf "$made"' EXIT
  cargo run --release --locked -- demo --out "$made/demo" >/dev/null
  cp "$made/demo/dag.svg" docs/demo-dag.svg
  cp "$made/demo/run.svg" docs/run.svg
fi
if [ "${1:-page}" = page ]; then
  tests/browser.sh --keep docs/dashboard.png
fi
