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

secured=("${workspace[@]}" --features roscausal_ros2/security)
nice cargo test -q --no-run "${secured[@]}" --bin roscausal_ros2 --test security || broken "the security feature does not build"
passed=0 failed=0
for test in "cargo test -q ${secured[*]} --test security" \
  "python3 tests/security/nodes.py $(program roscausal_ros2)"; do
  if $test; then passed=$((passed + 1)); echo "pass: $test"; else failed=$((failed + 1)); echo "FAIL: $test"; fi
done
echo "$passed passed, $failed failed"
[ "$failed" -eq 0 ]
