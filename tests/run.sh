#!/usr/bin/env bash
# All tests. Installs what they need and says loudly what it cannot install.
set -euo pipefail
cd "$(dirname "$0")/.."

cargo test --workspace --locked
