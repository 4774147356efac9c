#!/usr/bin/env bash
# Recording under load, for N minutes each on ROS 1 (where there is a master) and ROS 2: odometry at 1 kHz and 100 people
# at 25 Hz into a robot node, a human node and a data node in processes of their own. Prints the account, each node's
# share of a core and its memory over time; fails where a row is missing or a limit is passed.
# usage: benches/load.sh [MINUTES]      (default: 10)
set -euo pipefail
cd "$(dirname "$0")/.."
. tests/lib.sh
seconds=$((${1:-10} * 60))
for wire in ros1 ros2; do
    cargo build --quiet --release --locked -p "roscausal_$wire" --bins --example "${wire}_peer"
    code=0
    python3 tests/soak/load.py "$wire" "$(program "roscausal_$wire")" "$(program "examples/${wire}_peer")" "$seconds" ||
        code=$?
    if [ $code = 77 ]; then echo "!!! NOT MEASURED: $wire" >&2; elif [ $code != 0 ]; then exit $code; fi
done
