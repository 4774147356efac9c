#!/usr/bin/env python3
"""Makes single/parcorrwls_*.json and single/regressionci_*.json by running tigramite. usage: make_tests.py (writes into single/)

A variable of RegressionCI is of categories (data type 1) if it has at most ten values, all whole."""
import importlib.metadata as md, json, os, platform, warnings
os.environ.setdefault("OMP_NUM_THREADS", "1")
warnings.simplefilter("ignore")
import numpy as np
from tigramite.data_processing import DataFrame
from tigramite.independence_tests.parcorr_wls import ParCorrWLS
from tigramite.independence_tests.regressionCI import RegressionCI

HERE = os.path.dirname(os.path.abspath(__file__))
PEER = {name: md.version(name) for name in ("tigramite", "numpy", "scipy")} | {"python": platform.python_version()}
rng = np.random.default_rng(20261124)


def category(row):
    return len(set(row)) <= 10 and all(v == int(v) for v in row)


def write(test, kind, x, y, z):
    data = np.column_stack([x, y, z])
    types = np.tile([int(category(row)) for row in data.T], (len(x), 1))
    runs = {"ParCorrWLS": ParCorrWLS, "RegressionCI": RegressionCI}[test](significance="analytic")
    runs.set_dataframe(DataFrame(data, data_type=types) if test == "RegressionCI" else DataFrame(data))
    conditions = [(2 + k, 0) for k in range(z.shape[1])]
    value, p = runs.run_test(X=[(0, 0)], Y=[(1, 0)], Z=conditions, tau_max=0)
    id = f"{test.lower()}_{kind}_T{len(x)}_dz{z.shape[1]}"
    case = dict(
        schema="golden-single/1", id=id, kind=kind, test=dict(name=test, kwargs={}), T=len(x), dz=z.shape[1], x=x.tolist(), y=y.tolist(),
        z=z.tolist() if z.shape[1] else None, z_layout="z[sample][dimension]", peer=PEER, result=dict(val=float(value), pval=float(p)),
    )
    json.dump(case, open(f"{HERE}/single/{id}.json", "w"))
    print(id, value, p)


def system(n, dz, link, scale):
    z = rng.normal(size=(n, dz)) + 0.3
    x = z.sum(1) + scale * rng.normal(size=n)
    return x, z @ np.linspace(-0.5, 0.8, dz) + link * x + scale * rng.normal(size=n), z


for kind, n, dz, link in [("grows", 120, 0, 0.2), ("grows", 150, 2, 0.3), ("grows", 90, 1, 0.0), ("waves", 200, 3, 0.2), ("waves", 30, 5, 0.5), ("steady", 100, 1, 0.2)]:
    scale = {"grows": np.linspace(0.2, 3, n), "waves": 1.2 + np.sin(np.arange(n) / 9), "steady": np.ones(n)}[kind]
    write("ParCorrWLS", kind, *system(n, dz, link, scale))


def cut(row, values):
    return np.digitize(row, np.quantile(row, np.arange(1, values) / values)).astype(float)


for n, dz, link in [(120, 0, 0.2), (150, 2, 0.3), (60, 4, 0.0)]:
    write("RegressionCI", "numbers", *system(n, dz, link, 1.0))
for values, n, dz, link in [(2, 150, 1, 0.4), (3, 200, 0, 0.1), (4, 180, 2, 0.5)]:
    x, y, z = system(n, dz, link, 1.0)
    write("RegressionCI", f"category{values}", cut(x, values), y, z)
    write("RegressionCI", f"tocategory{values}", x, cut(y, values), z)
for values, n in [(2, 160), (4, 240)]:
    x, y, z = system(n, 2, 0.4, 1.0)
    write("RegressionCI", f"given{values}", x, y, np.column_stack([cut(z[:, 0], values), z[:, 1]]))
for a, b in [(2, 2), (3, 3), (4, 3)]:
    x, y, z = system(200, 0, 0.4, 1.0)
    write("RegressionCI", f"categories{a}{b}", cut(x, a), cut(y, b), z)
