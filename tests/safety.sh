#!/usr/bin/env bash
# What comes with data starts no program, writes nothing elsewhere and opens no socket: the command under strace. Exit code 0 only if
# all passed, 77 if strace cannot be installed.
set -uo pipefail
cd "$(dirname "$0")/.."
. tests/lib.sh
command -v strace >/dev/null || debian strace
prepare_only "$@"
cargo test -q "${workspace[@]}" --test travel -- --ignored
