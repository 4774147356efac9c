#!/usr/bin/env bash
# What empty cells cost: CPU seconds of `roscausal discover` with ParCorr on a table with empty cells over those on the same table
# without, in one run on one core, the least of five runs each; prints the table in Markdown. Fails where it is more than 5 times.
# usage: benches/missing.sh [PROGRAM]      (default: the release build of this clone)
set -euo pipefail
cd "$(dirname "$0")/.."
. tests/lib.sh
profile=release
if [ $# = 0 ]; then
  cargo build --quiet --release --locked -p roscausal --bin roscausal
  set -- "$(program roscausal)"
fi
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 - "$1" "$work" <<'PY'
import os, random, subprocess, sys

roscausal, work = sys.argv[1:]
MOST, RUNS = 5, 5


def write(path, rows, columns, empty):
    """A chain: each column follows the one before it, a row later. `empty` cells of it, drawn by chance, are empty."""
    noise, before = random.Random(1), [0.0] * columns
    gone = set(random.Random(2).sample(range(rows * columns), empty))
    with open(path, "w") as file:
        file.write("time," + ",".join(f"x{k}" for k in range(columns)) + "\n")
        for row in range(rows):
            now = [0.5 * before[k] + (0.3 * before[k - 1] if k else 0.0) + noise.random() - 0.5 for k in range(columns)]
            cells = ["" if row * columns + k in gone else f"{value:.6f}" for k, value in enumerate(now)]
            file.write(f"{row / 10}," + ",".join(cells) + "\n")
            before = now


def cpu(path):
    command = [roscausal, "discover", path, "--method", "pcmci", "--test", "parcorr", "--format", "json"]
    done = subprocess.Popen(["taskset", "-c", "0", *command], cwd=work, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    errors = done.stderr.read().decode()
    _, status, used = os.wait4(done.pid, 0)
    assert status == 0, f"{command}: {errors}"
    return used.ru_utime


print("| rows | columns | empty cells | CPU s, whole | CPU s, with them | ratio |")
print("|---|---|---|---|---|---|")
late = False
for rows, columns, empty in ((43_824, 5, 1), (8_759, 36, 41_771)):
    whole, holed = os.path.join(work, "whole.csv"), os.path.join(work, "holed.csv")
    write(whole, rows, columns, 0)
    write(holed, rows, columns, empty)
    runs = [(cpu(whole), cpu(holed)) for _ in range(RUNS)]
    a, b = (min(times) for times in zip(*runs))
    print(f"| {rows} | {columns} | {empty} | {a:.2f} | {b:.2f} | {b / a:.1f} |", flush=True)
    late |= b > MOST * a
sys.exit(f"more than {MOST} times" if late else 0)
PY
