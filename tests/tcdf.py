"""The answers of examples/methods/tcdf: what cd_method_dir asks of a program, the same bytes each time, and links that are there.

usage: tcdf.py PYTHON (one that has PyTorch)"""

import json
import os
import random
import subprocess
import sys
import tempfile
from pathlib import Path

PROGRAM = Path(__file__).resolve().parents[1] / "examples/methods/tcdf"
SETTINGS = dict(alpha=0.05, pc_alpha=0.2, f_alpha=None, cond_ind_test="gpdc", fdr="none", exogenous=[], threads=1, max_memory=None)


def batch(path, seed, rows=300):
    """`b` follows `a` one step later, `c` follows `b` two steps later; `d` is alone."""
    rng = random.Random(seed)
    x = [[rng.gauss(0, 1) for _ in range(4)] for _ in range(rows)]
    for t in range(2, rows):
        x[t][1] = 1.2 * x[t - 1][0] + 0.5 * x[t][1]
        x[t][2] = 1.2 * x[t - 2][1] + 0.5 * x[t][2]
    lines = ["time,a,b,c,d"] + [f"{0.1 * t:.1f}," + ",".join(map(repr, row)) for t, row in enumerate(x)]
    path.write_text("\n".join(lines) + "\n")
    return path


def ask(batches, epochs=150, **change):
    settings = SETTINGS | dict(tau_min=1, tau_max=2, seed=42) | change
    return subprocess.run(
        [sys.argv[1], PROGRAM, *batches], input=json.dumps(settings), capture_output=True, text=True,
        env=os.environ | {"TCDF_EPOCHS": str(epochs), "TCDF_RATE": "0.02"},
    )  # fmt: skip


def links(answer):
    names = answer["features"]
    return {
        (names[i], names[j], lag)
        for i, row in enumerate(answer["graph"]) for j, lags in enumerate(row) for lag, mark in enumerate(lags)
        if mark == "-->" and i != j
    }  # fmt: skip


def check(what, holds, told=""):
    print(f"{'ok' if holds else 'FAILED'}: {what} {'' if holds else told}", flush=True)
    return holds


def main():
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        files = [batch(folder / f"data_{k}.csv", k) for k in (1, 2)]
        first, again = ask(files), ask(files)
        if first.returncode:
            sys.exit(first.stderr)
        answer = json.loads(first.stdout)
        shape = lambda matrix: {(len(matrix), len(row), len(lags)) for row in matrix for lags in row}
        found = links(answer)
        zero = json.loads(ask([files[0]], epochs=3, tau_min=0, tau_max=1).stdout)
        alone = json.loads(ask([files[0]], epochs=3, exogenous=["b"]).stdout)
        short = folder / "short.csv"
        short.write_text("a,b\n1,2\n2,1\n")
        refused = ask([short])
        turned = {"": "", "-->": "<--", "<--": "-->", "<->": "<->"}
        checks = [
            check("the same bytes each time", first.stdout == again.stdout),
            check("the time is not a variable", answer["features"] == ["a", "b", "c", "d"], answer["features"]),
            check("matrices are as documented", all(shape(answer[name]) == {(4, 4, 3)} for name in ("val_matrix", "p_matrix", "graph"))),
            check("a -> b at lag 1 and b -> c at lag 2 are found", {("a", "b", 1), ("b", "c", 2)} <= found, found),
            check("neither is turned round, and d is alone", not any(("b", "a") == pair[:2] or ("c", "b") == pair[:2] or "d" in pair for pair in found), found),
            check("both readings of a pair at lag 0 agree", all(zero["graph"][i][j][0] == turned[zero["graph"][j][i][0]] for i in range(4) for j in range(4) if i != j)),
            check("nothing drives an exogenous variable", all(not mark for row in alone["graph"] for mark in row[1]), alone["graph"]),
            check("too few rows are one sentence", refused.returncode != 0 and len(refused.stderr.strip().splitlines()) == 1 and "record longer" in refused.stderr, refused.stderr),
        ]  # fmt: skip
    print(f"{sum(checks)} passed, {len(checks) - sum(checks)} failed")
    sys.exit(0 if all(checks) else 1)


main()
