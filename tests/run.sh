#!/usr/bin/env bash
# All tests: Rust's own, then those against other software, format, lints and documentation. Installs what they need, and
# reports loudly what it cannot install. Exit code 0 only if nothing failed.
set -uo pipefail
cd "$(dirname "$0")/.."

# Everything is built once, optimised as catkin and colcon build it, but with the checks of a debug build.
export CARGO_PROFILE_RELEASE_DEBUG_ASSERTIONS=true CARGO_PROFILE_RELEASE_OVERFLOW_CHECKS=true

results=$(mktemp)
trap 'rm -f "$results"' EXIT
run() { # what, then the command
  local what=$1
  shift
  "$@"
  echo "$? $what" >>"$results"
}
# One script after the other; each line of output bears its script's name.
lane() {
  for script in "$@"; do run "$script" named "$script"; done
}
named() {
  "$1" 2>&1 | sed -u "s|^|$(basename "$1" .sh): |"
  return "${PIPESTATUS[0]}"
}

run "cargo test" cargo test --release --workspace --exclude roscausal_py --locked
# Once more for the eye: how many of the reference's results (tests/golden) are met.
run golden cargo test --release --workspace --exclude roscausal_py --locked --test golden -- --nocapture
# Side by side: what computes, and what waits for nodes.
lane tests/gpdc_python.sh tests/recordings.sh tests/python.sh tests/lint.sh &
lane tests/interop/ros2.sh tests/interop/ros1.sh tests/browser.sh tests/security.sh tests/soak.sh
wait

sed -n 's/^77 \(.*\)/!!! NOT TESTED: \1 could not install what it needs (see above)/p' "$results" >&2
sed -n '/^\(0\|77\) /!s/^[0-9]* \(.*\)/!!! FAILED: \1/p' "$results" >&2
! grep -qvE '^(0|77) ' "$results"
