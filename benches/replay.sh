#!/usr/bin/env bash
# CPU seconds and peak memory of `roscausal replay` and `roscausal discover` on long recordings (100 Hz odometry and
# pose, 20 people at 25 Hz), as MCAP, ROS 1 bag and ROS 2 database, on one core; prints the table in Markdown.
# usage: benches/replay.sh [MINUTES...]      (default: 15 30)
set -euo pipefail
[ $# -gt 0 ] || set -- 15 30
cd "$(dirname "$0")/.."
. tests/lib.sh
profile=release
work=$PWD/target/replay
mkdir -p "$work"
environment "$work/venv" rosbags==0.11.9
cargo build --quiet --release --locked -p roscausal -p roscausal_recording --bin roscausal --example long_recording
"$work/venv/bin/python" - "$(program roscausal)" "$(program examples/long_recording)" "$work" "$@" <<'PY'
import os, shutil, subprocess, sys, time

roscausal, example, work, *minutes = sys.argv[1:]
converter = os.path.join(work, "venv/bin/rosbags-convert")


def measured(command):
    """(CPU seconds, wall seconds, peak MB)"""
    begin = time.monotonic()
    done = subprocess.Popen(["taskset", "-c", "0", *command], cwd=out, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    errors = done.stderr.read().decode()
    _, status, used = os.wait4(done.pid, 0)
    assert status == 0, f"{command}: {errors}"
    return used.ru_utime + used.ru_stime, time.monotonic() - begin, used.ru_maxrss / 1024


print("| minutes | file | size, MB | command | CPU s | wall s | peak memory, MB |")
print("|---|---|---|---|---|---|---|")
for length in minutes:
    mcap, bag, folder = (os.path.join(work, length + suffix) for suffix in (".mcap", ".bag", "_db3"))
    if not os.path.exists(mcap):
        subprocess.run([example, mcap, length], check=True)
    for to, more in ((bag, []), (folder, ["--dst-storage", "sqlite3"])):
        if not os.path.exists(to):
            subprocess.run([converter, "--src", mcap, "--dst", to, *more], check=True)
    database = next(os.path.join(folder, name) for name in os.listdir(folder) if name.endswith(".db3"))
    for file in (mcap, bag, database):
        for command in ("replay", "discover"):
            out = os.path.join(work, "out")
            shutil.rmtree(out, ignore_errors=True)
            os.makedirs(out)
            times = sorted(measured([roscausal, command, file, "--out", out, "--method", "pcmci", "--test", "parcorr"]) for _ in range(3))
            cpu, wall, memory = times[1]
            size = os.path.getsize(file) / 1e6
            print(f"| {length} | {os.path.splitext(file)[1]} | {size:.0f} | {command} | {cpu:.1f} | {wall:.1f} | {memory:.0f} |", flush=True)
PY
