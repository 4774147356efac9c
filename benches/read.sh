#!/usr/bin/env bash
# Reading a large table: CPU seconds and peak memory of `roscausal discover` with ParCorr on a CSV file of 1e6 rows and 10 columns,
# once with 6 digits and once with all 17 (as pandas writes them), on one core; prints the table in Markdown. Each figure is the median of
# three runs. Fails if the first takes more than 1.5 s of CPU or 400 MB. Run it beside nothing else.
# usage: benches/read.sh [ROWS]      (default: 1000000)
set -euo pipefail
cd "$(dirname "$0")/.."
. tests/lib.sh
profile=release
work=$PWD/target/read
mkdir -p "$work"
cargo build --quiet --release --locked -p roscausal --bin roscausal
python3 - "$(program roscausal)" "$work" "${1:-1000000}" <<'PY'
import os, random, subprocess, sys, time

roscausal, work, rows = sys.argv[1], sys.argv[2], int(sys.argv[3])
COLUMNS = 10
CPU_S, MEMORY_MB = 1.5, 400  # what is aimed at, of 1e6 rows with 6 digits


def write(path, form):
    """A chain: each column follows the one before it, a row later."""
    noise = random.Random(1)
    before = [0.0] * COLUMNS
    with open(path + ".part", "w") as file:
        file.write("time," + ",".join(f"x{k}" for k in range(COLUMNS)) + "\n")
        for row in range(rows):
            now = [0.5 * before[k] + (0.3 * before[k - 1] if k else 0.0) + noise.random() - 0.5 for k in range(COLUMNS)]
            file.write(f"{row / 10}," + ",".join([form(value) for value in now]) + "\n")
            before = now
    os.rename(path + ".part", path)


def measured(command):
    """CPU seconds, wall seconds, peak MB"""
    begin = time.monotonic()
    done = subprocess.Popen(["taskset", "-c", "0", *command], cwd=work, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    errors = done.stderr.read().decode()
    _, status, used = os.wait4(done.pid, 0)
    assert status == 0, f"{command}: {errors}"
    return used.ru_utime + used.ru_stime, time.monotonic() - begin, used.ru_maxrss / 1024


print("| rows | columns | digits | size, MB | CPU s | wall s | peak memory, MB |")
print("|---|---|---|---|---|---|---|")
late = False
for digits, form in ((6, "{:.6f}".format), (17, repr)):
    path = os.path.join(work, f"{rows}_{digits}.csv")
    if not os.path.exists(path):
        write(path, form)
    command = [roscausal, "discover", path, "--method", "pcmci", "--test", "parcorr", "--format", "json"]
    cpu, wall, memory = sorted(measured(command) for _ in range(3))[1]
    size = os.path.getsize(path) / 1e6
    print(f"| {rows} | {COLUMNS} | {digits} | {size:.0f} | {cpu:.2f} | {wall:.2f} | {memory:.0f} |", flush=True)
    late |= digits == 6 and rows <= 1_000_000 and (cpu > CPU_S or memory > MEMORY_MB)
sys.exit("more than is aimed at" if late else 0)
PY
