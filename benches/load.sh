#!/usr/bin/env bash
# Recording under load, for N minutes each on ROS 1 (if there is a master) and ROS 2: odometry at 1 kHz and 100 people
# at 25 Hz into a robot node, a human node and a data node, each a process of its own; the data node also records 50
# signals of these topics. Prints the counts, each node's CPU usage and its memory over time. Fails if a row is missing, or
# if the data node takes more than 5 % of a core or 60 MB.
# usage: benches/load.sh [MINUTES]      (default: 10)
set -euo pipefail
cd "$(dirname "$0")/.."
. tests/lib.sh
profile=release
seconds=$((${1:-10} * 60))
for wire in ros1 ros2; do
    cargo build --quiet --release --locked -p "roscausal_$wire" --bins --example "${wire}_peer"
    code=0
    python3 tests/soak/load.py "$wire" "$(program "roscausal_$wire")" "$(program "examples/${wire}_peer")" "$seconds" ||
        code=$?
    if [ $code = 77 ]; then echo "!!! NOT MEASURED: $wire" >&2; elif [ $code != 0 ]; then exit $code; fi
done
