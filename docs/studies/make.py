#!/usr/bin/env python3
"""Makes the tables of the twelve studies: make.py [FOLDER]. Standard library only; the same bytes each time.

What is in which table is in truth.md. Read it after the summaries, not before.
"""

import random
import sys
from pathlib import Path

STEP = 0.1


def series(seed, rows, names, step, start=None):
    """Rows of a system: step(past, noise) gives the next values; past[-1] is the row before."""
    draw = random.Random(seed)
    past = [start or [0.0] * len(names) for _ in range(5)]
    for _ in range(rows + 50):
        past.append(step(past, [draw.gauss(0, 1) for _ in range(8 + len(names))]))
    return [list(row) for row in past[-rows:]]


def table(names, rows, times=None):
    times = times or [STEP * t for t in range(len(rows))]
    cell = lambda value: "" if value is None else f"{value:.4f}"
    lines = [",".join(["time", *names])]
    lines += [",".join([f"{time:.1f}", *map(cell, row)]) for time, row in zip(times, rows)]
    return "\n".join(lines) + "\n"


def s01():
    names = ["gait", "head", "hand"]
    rows = series(1, 400, names, lambda p, e: [0.5 * p[-1][0] + e[0], 0.9 * p[-1][0] + 0.3 * p[-1][1] + e[1], 0.4 * p[-1][2] + e[2]])
    return {"s01": table(names, rows)}


def s02():
    names = ["push", "lean", "turn"]
    rows = series(2, 400, names, lambda p, e: [e[0], 0.2 * p[-1][1] + e[1], 0.9 * p[-3][0] + e[2]])
    return {"s02": table(names, rows)}


def s03():
    names = ["light", "noise", "pace"]
    rows = series(3, 36, names, lambda p, e: [e[0], 0.5 * p[-1][0] + e[1], e[2]])
    return {"s03": table(names, rows)}


def s04():
    names = ["gaze", "near", "step", "tilt"]
    rows = series(4, 400, names, lambda p, e: [0.6 * p[-1][0] + e[0], 0.3 * p[-1][1] + e[1], e[2], 0.5 * p[-1][3] + e[3]])
    return {"s04": table(names, rows)}


def s05():
    names = ["gap", "unease"]
    rows = series(5, 400, names, lambda p, e: [0.4 * p[-1][0] + e[0], 0.8 * p[-1][0] ** 2 + e[1]])
    return {"s05": table(names, rows)}


def s06():
    files = {}
    for k, (a, b) in enumerate([(0, 0), (4, 3), (9, 7)]):
        names = ["room", "stride"]
        rows = series(60 + k, 200, names, lambda p, e: [0.3 * p[-1][0] + e[0], 0.3 * p[-1][1] + e[1]])
        files[f"s06_{'abc'[k]}"] = table(names, [[x + a, y + b] for x, y in rows])
    return files


def s07():
    names = ["crowd", "talk", "walk"]
    rows = series(7, 400, names, lambda p, e: [0.5 * p[-1][0] + e[0], 0.8 * p[-1][0] + e[1], 0.8 * p[-2][0] + e[2]])
    return {"s07": table(names, rows)}


def s08():
    names = ["blink", "nod", "other"]
    rows = series(8, 400, names, lambda p, e: [0.8 * p[-1][2] + e[0], 0.8 * p[-2][2] + e[1], 0.5 * p[-1][2] + e[2]])
    return {"s08": table(names[:2], [row[:2] for row in rows])}


def s09():
    names = ["reach", "grip"]
    draw = random.Random(99)
    rows = series(9, 500, names, lambda p, e: [0.4 * p[-1][0] + e[0], 0.7 * p[-1][0] + e[1]])
    times = [STEP * t for t in range(500)]
    kept = [t for t in range(500) if not 200 <= t < 260]
    rows = [[None if draw.random() < 0.08 else value for value in rows[t]] for t in kept]
    return {"s09": table(names, rows, [times[t] for t in kept])}


def s10():
    names = ["zone", "stress"]
    rows = series(10, 400, names, lambda p, e: [0.5 * p[-1][0] + e[0], 0.8 * p[-1][0] + e[1]])
    return {"s10": table(names, [[round(x), round(y)] for x, y in rows])}


def s11():
    names = [f"v{k}" for k in range(10)]

    def step(p, e):
        new = [0.3 * p[-1][k] + e[k] for k in range(10)]
        new[4] += 0.7 * p[-1][1]
        new[7] += 0.7 * p[-1][4]
        new[2] -= 0.7 * p[-1][8]
        return new

    return {"s11": table(names, series(11, 300, names, step))}


def s12():
    names = ["voice", "smile"]
    clock = iter(range(10_000))

    def step(p, e):
        sign = 0.8 if next(clock) - 50 < 200 else -0.8
        return [e[0], sign * p[-1][0] + e[1]]

    return {"s12": table(names, series(12, 400, names, step))}


def main():
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).parent)
    folder.mkdir(parents=True, exist_ok=True)
    for study in [s01, s02, s03, s04, s05, s06, s07, s08, s09, s10, s11, s12]:
        for name, text in study().items():
            (folder / f"{name}.csv").write_text(text)


if __name__ == "__main__":
    main()
