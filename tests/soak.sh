#!/usr/bin/env bash
# Faults for N minutes (default 1). The whole chain in one process is killed at random, runs on a disk that fills up and in
# a folder that becomes read-only, and is flooded at ten times the rate. The nodes run on ROS 1 with a master that is
# killed, and on ROS 2 with a network that is cut. Each part ends with counts of what went in and what came out. Ends with
# 'N passed, N failed'.
# usage: tests/soak.sh [minutes]
set -uo pipefail
cd "$(dirname "$0")/.."
minutes=${1:-1}
passed=0 failed=0
check() { # check NAME COMMAND...
    local name=$1
    shift
    if "$@"; then passed=$((passed + 1)); echo "pass: $name"; else failed=$((failed + 1)); echo "FAIL: $name"; fi
}
. tests/lib.sh
prepare_only "$@"
build_all --quiet || exit 1
chain=$(program examples/chain)
work=$(mktemp -d)
disk=$work/disk readonly=$work/readonly
chain_pid=
# Ends what this script started, and nothing else.
finish() {
    [ -n "$chain_pid" ] && kill "$chain_pid" 2>/dev/null
    for folder in "$disk" "$readonly" "$work/view"; do mountpoint -q "$folder" && umount -l "$folder"; done
    rm -rf --one-file-system "$work"
}
trap finish EXIT

count() { find "$1" -maxdepth 1 -name "$2" ! -name '.*' 2>/dev/null | wc -l; }
rows() { find "$1" -maxdepth 1 -name '*.csv' ! -name '.*' -exec cat {} + 2>/dev/null | grep -vc '^time'; }
# Its output lies beside its folder, because the folder may be on a full disk.
begin() { "$chain" "$@" >"$1.said" 2>"$1.log" & chain_pid=$!; }
sent() { sed -n 's/^sent: \([0-9]*\) odometry.*/\1/p' "$1.said"; } # odometry messages, once it has ended
end() { touch "$1/stop"; wait "$chain_pid"; local code=$?; chain_pid=; rm -f "$1/stop"; return $code; }

# 1. Random kills: every batch complete, every model once, values right, loss within the bound.
kills=$((minutes * 15))
check "$kills random kill -9: every batch whole, every model once" \
    env ROSCAUSAL_KILLS=$kills cargo test -q "${workspace[@]}" --test kill -- --nocapture

# 2. Ten times the rate.
flood=$work/flood
mkdir -p "$flood"
begin "$flood" 500 20 0.1 5
sleep $((minutes * 15))
check "flood: ends well" end "$flood"
sent=$(sent "$flood")
wanted=$((${sent:-0} / 50))
got=$(rows "$flood/raw")
echo "flood: $sent odometry messages in, $got rows out (about $wanted wanted), $(count "$flood/raw" '*.csv') batches," \
    "$(count "$flood/models" '*.json') models"
# The first second may be missing because nobody is there yet, and the last because it may still change.
check "flood: no row lost" test "$got" -ge $((wanted - 20))
check "flood: every complete batch has a model" \
    test $(($(count "$flood/models" '*.json') + $(count "$flood/pp" '*.csv') + $(count "$flood/pp/incomplete" '*.csv'))) \
    -eq "$(count "$flood/raw" '*.csv')"

# 3. A full disk that gets space again.
if mkdir -p "$disk" && mount -t tmpfs -o size=3m tmpfs "$disk" 2>/dev/null; then
    dd if=/dev/zero of="$disk/ballast" bs=1k count=2900 status=none
    begin "$disk" 50 2 0.05 1
    sleep 12
    check "full disk: the nodes live" kill -0 "$chain_pid"
    full=$(count "$disk/raw" '*.csv')
    check "full disk: it is said" grep -q -i "no space left" "$disk.log"
    rm "$disk/ballast"
    sleep 6
    check "full disk: ends well" end "$disk"
    got=$(rows "$disk/raw")
    sent=$(sent "$disk")
    echo "full disk: $full batches while full, $(count "$disk/raw" '*.csv') afterwards, $got rows of about $((${sent:-0} * 20 / 50))"
    check "full disk: no row lost" test "$got" -ge $((${sent:-0} * 20 / 50 - 40))
else
    echo "skipped: a full disk needs root (mount -t tmpfs)"
fi

# 4. A folder that becomes read-only under the nodes, and writable again.
mkdir -p "$readonly" "$work/view"
if mount --bind "$readonly" "$work/view" 2>/dev/null && mount -o remount,bind,ro "$work/view"; then
    begin "$readonly" 50 2 0.05 1
    sleep 5
    # Open files stay writable, because they were opened below this mount.
    mount --bind "$work/view" "$readonly"
    before=$(count "$readonly/raw" '*.csv')
    sleep 8
    check "read-only folder: the nodes live" kill -0 "$chain_pid"
    check "read-only folder: no batch gets in" test "$(count "$readonly/raw" '*.csv')" -eq "$before"
    check "read-only folder: it is said" grep -q -i "read-only file system" "$readonly.log"
    umount -l "$readonly"
    sleep 6
    check "read-only folder: ends well" end "$readonly"
    got=$(rows "$readonly/raw")
    sent=$(sent "$readonly")
    echo "read-only folder: $before batches before, $(count "$readonly/raw" '*.csv') afterwards, $got rows of about $((${sent:-0} * 20 / 50))," \
        "$(count "$readonly/models" '*.json') models"
    check "read-only folder: no row lost" test "$got" -ge $((${sent:-0} * 20 / 50 - 40))
else
    echo "skipped: a read-only folder needs root (mount --bind)"
fi

# 5. Logs that cannot be written.
for wire in ros1 ros2; do
    nodes=$(program "roscausal_$wire")
    # Without a master the ROS 1 node waits, and says so.
    ROS_MASTER_URI=http://127.0.0.1:1/ ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST timeout -s INT 4 "$nodes" robot 2>/dev/full
    code=$?
    # 124: it ran until it was stopped.
    check "a log that cannot be written: the node of $wire lives" test "$code" -eq 124
done

# 6. Faults of the middleware, under the real nodes.
for fault in "a ROS master that is killed:master:ros1" "a network that is cut:network:ros2"; do
    IFS=: read -r name what nodes <<<"$fault"
    python3 tests/soak/faults.py "$what" "$(program "roscausal_$nodes")" $((minutes * 15))
    code=$?
    if [ $code = 77 ]; then echo "!!! NOT TESTED: $name" >&2; else check "$name: nothing lost but what was not sent" test $code = 0; fi
done

echo "$passed passed, $failed failed"
[ "$failed" -eq 0 ]
