#!/usr/bin/env python3
"""Draws a model as tigramite and causalflow do, to look at beside our pictures of it: beside.py FOLDER [OUT]

FOLDER is one of `roscausal discover --out FOLDER`; docs/beside/ was made with
  roscausal discover docs/studies/s07.csv --method pcmci --test parcorr --tau-max 3 --out found
  docs/beside.py found

Needs tigramite, py-causalflow, netgraph, rectangle-packer, grandalf and networkx. Only their public functions are called.
"""

import json
import pathlib
import shutil
import sys

import matplotlib
import numpy as np

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from causalflow.graph.DAG import DAG
from tigramite import plotting

HERE = pathlib.Path(__file__).resolve().parent / "beside"


def trimmed(path, most=800):
    """Without the empty margins, and not larger than `most` pixels across."""
    picture = plt.imread(path)[..., :3]
    rows, columns = (np.flatnonzero((picture < 1).any(axis=axis)) for axis in ((1, 2), (0, 2)))
    picture = picture[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    step = -(-picture.shape[1] // most)
    picture = picture[: picture.shape[0] // step * step, : picture.shape[1] // step * step]
    plt.imsave(path, picture.reshape(picture.shape[0] // step, step, -1, step, 3).mean(axis=(1, 3)))


def main(found, out=HERE):
    found, out = pathlib.Path(found), pathlib.Path(out)
    out.mkdir(parents=True, exist_ok=True)
    model = json.loads((found / "model.json").read_text())
    names, graph = model["features"], np.array(model["graph"], dtype="<U3")
    values = np.array([[[value or 0.0 for value in lags] for lags in row] for row in model["val_matrix"]])
    for name, draw in [("dag", plotting.plot_graph), ("tsdag", plotting.plot_time_series_graph)]:
        shutil.copy(found / f"{name}.svg", out)
        draw(graph=graph, val_matrix=values, var_names=names, figsize=(6, 4.5))
        plt.savefig(out / f"tigramite-{name}.png", dpi=80, bbox_inches="tight")
        plt.close("all")
        trimmed(out / f"tigramite-{name}.png")
    theirs = DAG(names, model["tau_min"], model["tau_max"])
    for link in model["links"]:
        theirs.add_source(link["effect"], link["cause"], link["value"], link["p_value"], link["lag"], link["mark"])
    # Its summary graph (`dag`) cannot be drawn without a link at lag 0 (4.0.5).
    theirs.ts_dag(save_name=str(out / "causalflow-tsdag"))
    trimmed(out / "causalflow-tsdag.png")


if __name__ == "__main__":
    main(*sys.argv[1:])
