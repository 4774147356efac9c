"""Writes the same table as CSV, Parquet, Arrow and NumPy files, with numpy, pandas and pyarrow.

usage: write.py FOLDER

`a` drives `b` one step later; `state` holds words; the index of the data frame is written too where pandas does so by default.
"""

import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.feather as feather
import pyarrow.ipc as ipc
import pyarrow.parquet as pq


def main():
    folder = Path(sys.argv[1])
    rng = np.random.default_rng(3)
    rows, a, b = 200, np.zeros(200), np.zeros(200)
    for t in range(1, rows):
        a[t] = 0.4 * a[t - 1] + rng.uniform(-0.5, 0.5)
        b[t] = 0.3 * b[t - 1] + 0.8 * a[t - 1] + 0.5 * rng.uniform(-0.5, 0.5)
    a, b = a.round(6), b.round(6)
    time = np.arange(rows) * 0.25
    frame = pd.DataFrame({"time": time, "a": a, "b": b})
    frame.to_csv(folder / "plain.csv", index=False)
    frame.iloc[5:].to_parquet(folder / "index.parquet")  # rows that do not begin at 0: pandas writes their numbers
    stamped = frame.drop(columns="time").set_index(pd.Timestamp("2026-11-24T08:00:00Z") + pd.to_timedelta(time, unit="s"))
    stamped.to_parquet(folder / "stamps.parquet", compression="zstd")
    words = frame.assign(state=pd.Categorical(np.where(a > 0, "walk", "idle")), flag=a > b, n=np.arange(rows, dtype="int32") % 7)
    words.to_parquet(folder / "words.parquet", compression="gzip")
    table = pa.Table.from_pandas(frame, preserve_index=False)
    pq.write_table(table, folder / "groups.parquet", row_group_size=64, compression="lz4")
    feather.write_feather(table, folder / "feather.arrow", compression="lz4")
    with ipc.new_stream(folder / "stream.arrows", table.schema) as stream:
        stream.write_table(table, max_chunksize=50)
    np.savez(folder / "named.npz", time=time, a=a, b=b)
    np.savez_compressed(folder / "matrix.npz", time=time, data=np.column_stack([a, b]).astype("f8"), names=np.array(["a", "b"]))
    np.savez_compressed(folder / "words.npz", time=time, a=a, b=b, state=np.where(a > 0, "walk", "idle"))
    fields = np.empty(rows, dtype=[("time", "f8"), ("a", ">f8"), ("b", "f8")])
    fields["time"], fields["a"], fields["b"] = time, a, b
    np.save(folder / "fields.npy", fields)
    np.save(folder / "object.npy", np.array([{"a": 1}, None], dtype=object), allow_pickle=True)


if __name__ == "__main__":
    main()
