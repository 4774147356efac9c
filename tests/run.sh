#!/usr/bin/env bash
# All tests: Rust's own, then those against other software, format, lints and documentation. Installs what they need, and
# reports loudly what it cannot install. Exit code 0 only if nothing failed. Ends with the time of each part.
set -uo pipefail
cd "$(dirname "$0")/.."

# Everything is built once, optimised as catkin and colcon build it, but with the checks of a debug build.
export CARGO_PROFILE_RELEASE_DEBUG_ASSERTIONS=true CARGO_PROFILE_RELEASE_OVERFLOW_CHECKS=true

results=$(mktemp)
trap 'rm -f "$results"' EXIT
run() { # what, then the command
  local what=$1 begun=$SECONDS
  shift
  "$@"
  echo "$? $((SECONDS - begun)) $what" >>"$results"
}
# One script after the other; each line of output bears its script's name.
lane() {
  for script in "$@"; do run "$script" named "$script"; done
}
named() { # script, then its arguments
  "$@" 2>&1 | sed -u "s|^|$(basename "$1" .sh): |"
  return "${PIPESTATUS[0]}"
}

computing=(tests/gpdc_python.sh tests/recordings.sh tests/python.sh tests/lint.sh)
# One after the other: each builds the programs of its own version of ROS in place.
waiting=(tests/interop/ros2.sh tests/interop/ros1.sh tests/browser.sh tests/security.sh tests/soak.sh)

# What the scripts need is fetched while cargo builds. Where this fails the script itself tells it, below.
for script in "${waiting[@]}" "${computing[@]}"; do named "$script" --prepare; done &
preparing=$!
run "building" cargo test --release --workspace --exclude roscausal_py --locked --no-run
run "cargo test" cargo test --release --workspace --exclude roscausal_py --locked
wait "$preparing"

# Side by side: what waits for nodes, and what computes, which leaves the cores to the others when they want them.
lane "${waiting[@]}" &
lane "${computing[@]}" &
renice -n 10 -p $! >/dev/null 2>&1 || true
wait

sed -n 's/^[0-9]* \([0-9]*\) \(.*\)/\2: \1 s/p' "$results"
sed -n 's/^77 [0-9]* \(.*\)/!!! NOT TESTED: \1 could not install what it needs (see above)/p' "$results" >&2
sed -n '/^\(0\|77\) /!s/^[0-9]* [0-9]* \(.*\)/!!! FAILED: \1/p' "$results" >&2
! grep -qvE '^(0|77) ' "$results"
