#!/usr/bin/env bash
# DDS Security of ROS 2 with a keystore as SROS2 makes it: without a certificate nobody reads or writes, an enclave uses
# only what it is granted, and the whole chain of nodes works. Exit code 0 only if all passed, 77 if what it needs cannot
# be installed. The last line is 'N passed, N failed'.
set -uo pipefail
cd "$(dirname "$0")/.."
. tests/lib.sh
missing=()
command -v openssl >/dev/null || missing+=(openssl)
command -v pkg-config >/dev/null || missing+=(pkg-config)
# The headers of the library, found the way the build finds them.
pkg-config --exists openssl 2>/dev/null || missing+=(libssl-dev)
[ ${#missing[@]} -eq 0 ] || debian "${missing[@]}"
prepare_only "$@"

secured=(cargo test -q "${workspace[@]}" --features roscausal_ros2/security --test security)
special security nice "${secured[@]}" --no-run || broken "the security feature does not build"
passed=0 failed=0
check() { # what, then the command
  local what=$1
  shift
  if "$@"; then passed=$((passed + 1)); echo "pass: $what"; else failed=$((failed + 1)); echo "FAIL: $what"; fi
}
check "topics, enclaves and permissions" special security "${secured[@]}"
check "the whole chain of nodes" python3 tests/security/nodes.py "$(special security program roscausal_ros2)"
echo "$passed passed, $failed failed"
[ "$failed" -eq 0 ]
