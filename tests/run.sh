#!/usr/bin/env bash
# All tests: Rust's own, then those against other software. Installs what they need, and reports loudly what it cannot
# install. Exit code 0 only if nothing failed.
set -uo pipefail
cd "$(dirname "$0")/.."

# Everything is built once, optimised as catkin and colcon build it, but with the checks of a debug build.
export CARGO_PROFILE_RELEASE_DEBUG_ASSERTIONS=true CARGO_PROFILE_RELEASE_OVERFLOW_CHECKS=true

failed=() untested=()
cargo test --release --workspace --exclude roscausal_py --locked || failed+=("cargo test")
# Once more for the eye: how many of the reference's results (tests/golden) are met.
cargo test --release --workspace --exclude roscausal_py --locked --test golden -- --nocapture || failed+=("golden")
for script in tests/python.sh tests/gpdc_python.sh tests/recordings.sh tests/browser.sh tests/security.sh \
  tests/interop/ros2.sh tests/interop/ros1.sh tests/soak.sh; do
  "$script"
  case $? in
    0) ;;
    77) untested+=("$script") ;;
    *) failed+=("$script") ;;
  esac
done

for each in ${untested[@]+"${untested[@]}"}; do echo "!!! NOT TESTED: $each could not install what it needs (see above)" >&2; done
for each in ${failed[@]+"${failed[@]}"}; do echo "!!! FAILED: $each" >&2; done
[ ${#failed[@]} -eq 0 ]
