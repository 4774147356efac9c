#!/usr/bin/env python3
"""Makes single/parcorrwls_*.json, regressionci_*, parcorrmult_* and gpdc_given_* by running tigramite. usage: make_tests.py (writes into single/)

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


def write_vectors(kind, n, dims, link):
    """ParCorrMult: X, Y and each node of Z have dims[0], dims[1], dims[2:] components."""
    from tigramite.independence_tests.parcorr_mult import ParCorrMult

    z = rng.normal(size=(n, sum(dims[2:]))) + 0.3
    shared = z.sum(1, keepdims=True) + link * rng.normal(size=(n, 1))
    x, y = (rng.normal(size=(n, d)) for d in dims[:2])
    x[:, -1:] += shared
    y[:, :1] += shared if kind != "independent" else z.sum(1, keepdims=True)
    data, first = np.column_stack([x, y, z]), np.cumsum([0, *dims])
    vectors = {k: [(c, 0) for c in range(first[k], first[k + 1])] for k in range(len(dims))}
    run = ParCorrMult(correlation_type="max_corr", significance="analytic")
    run.set_dataframe(DataFrame(data, vector_vars=vectors))
    value, p = run.run_test(X=[(0, 0)], Y=[(1, 0)], Z=[(k, 0) for k in range(2, len(dims))], tau_max=0)
    id = f"parcorrmult_{kind}_T{n}_{'_'.join(map(str, dims))}"
    case = dict(
        schema="golden-single/1", id=id, kind=kind, test=dict(name="ParCorrMult", kwargs={}), T=n, x=x.tolist(), y=y.tolist(), z=z.tolist(),
        z_dims=dims[2:], z_layout="z[sample][component]", peer=PEER, result=dict(val=float(value), pval=float(p)),
    )
    json.dump(case, open(f"{HERE}/single/{id}.json", "w"))
    print(id, value, p)


for kind, n, dims, link in [
    ("linked", 100, [2, 2], 0.4), ("linked", 150, [1, 3, 2], 0.3), ("linked", 80, [3, 1, 1, 2], 0.4), ("independent", 120, [2, 3, 2], 0.5),
    ("independent", 60, [2, 2, 2, 2, 1], 0.5), ("linked", 200, [1, 1, 1], 0.2),
]:  # fmt: skip
    write_vectors(kind, n, dims, link)


def write_given_null(n, dz, link, sizes, samples):
    """GPDC held against distributions that are given; where there is none for the number of samples, it makes its own."""
    import tempfile

    from tigramite.independence_tests.gpdc import GPDC

    file = f"{tempfile.mkdtemp()}/null.npz"
    GPDC(sig_samples=samples, seed=7).generate_and_save_nulldists(sizes, file)
    given = dict(zip(map(str, sizes), np.load(file)["exact_dist"].tolist()))
    x, y, z = system(n, dz, link, 1.0)
    y = y + 0.3 * x**2
    run = GPDC(null_dist_filename=file)
    run.set_dataframe(DataFrame(np.column_stack([x, y, z])))
    value, p = run.run_test(X=[(0, 0)], Y=[(1, 0)], Z=[(2 + k, 0) for k in range(dz)], tau_max=0)
    id = f"gpdc_given_T{n}_dz{dz}_{len(given)}"
    case = dict(
        schema="golden-single/1", id=id, kind="given", test=dict(name="GPDC", kwargs=dict(null_distributions=given)), T=n, dz=dz, x=x.tolist(),
        y=y.tolist(), z=z.tolist() if dz else None, z_layout="z[sample][dimension]", peer=PEER, result=dict(val=float(value), pval=float(p)),
    )
    json.dump(case, open(f"{HERE}/single/{id}.json", "w"))
    print(id, value, p)


for n, dz, link, sizes, samples in [(100, 1, 0.0, [100], 200), (150, 2, -0.1, [100, 150], 200), (120, 0, -0.1, [120], 400)]:
    write_given_null(n, dz, link, sizes, samples)
