"""Writes the same table as CSV and as NumPy files.

usage: write.py FOLDER

`a` drives `b` one step later; `state` holds words.
"""

import sys
from pathlib import Path

import numpy as np


def main():
    folder = Path(sys.argv[1])
    rng = np.random.default_rng(3)
    rows, a, b = 200, np.zeros(200), np.zeros(200)
    for t in range(1, rows):
        a[t] = 0.4 * a[t - 1] + rng.uniform(-0.5, 0.5)
        b[t] = 0.3 * b[t - 1] + 0.8 * a[t - 1] + 0.5 * rng.uniform(-0.5, 0.5)
    a, b = a.round(6), b.round(6)
    time = np.arange(rows) * 0.25
    lines = [f"{t},{x},{y}" for t, x, y in zip(time, a, b)]
    (folder / "plain.csv").write_text("\n".join(["time,a,b", *lines]) + "\n")
    np.savez(folder / "named.npz", time=time, a=a, b=b)
    np.savez_compressed(folder / "matrix.npz", time=time, data=np.column_stack([a, b]), names=np.array(["a", "b"]))
    np.savez_compressed(folder / "words.npz", time=time, a=a, b=b, state=np.where(a > 0, "walk", "idle"))
    fields = np.empty(rows, dtype=[("time", "f8"), ("a", ">f8"), ("b", "f8")])
    fields["time"], fields["a"], fields["b"] = time, a, b
    np.save(folder / "fields.npy", fields)
    np.save(folder / "object.npy", np.array([{"a": 1}, None], dtype=object), allow_pickle=True)


if __name__ == "__main__":
    main()
