#!/usr/bin/env python3
"""Makes this folder's numbers with numpy and scipy, straight from the definitions. usage: make.py (writes beside itself)

Partial correlation: least-squares residuals of the standardised rows, Pearson correlation, two-sided Student t with
n - 2 - |Z| degrees of freedom. RobustParCorr: the same of normal scores. PCMCI and PCMCI+ skeleton conditions as in
Runge et al. 2019; samples 2 tau_max .. T-1."""
import json, os
import numpy as np
from scipy import stats
HERE = os.path.dirname(os.path.abspath(__file__))

def scores(rows):
    out = []
    for r in rows:
        u = np.array([np.sum(r <= v) for v in r]) / len(r)
        out.append(stats.norm.ppf(np.where(u == 1.0, 1 - 1e-5, u)))
    return out

def parcorr(x, y, z, robust=False):
    rows = [np.asarray(r, float) for r in [x, y, *z]]
    if robust: rows = scores(rows)
    rows = [(r - r.mean()) / r.std() for r in rows]
    if z:
        Z = np.array(rows[2:]).T
        res = [r - Z @ np.linalg.lstsq(Z, r, rcond=None)[0] for r in rows[:2]]
    else: res = rows[:2]
    a, b = [r - r.mean() for r in res]
    r = float(a @ b / np.sqrt((a @ a) * (b @ b))); df = len(x) - 2 - len(z)
    return r, float(2 * stats.t.sf(abs(r) * np.sqrt(df / (1 - r * r)), df))

def write(path, o):
    os.makedirs(os.path.dirname(f"{HERE}/{path}"), exist_ok=True)
    json.dump(o, open(f"{HERE}/{path}", "w"))

rng = np.random.default_rng(20260101)
for k, (T, dz, robust) in enumerate([(60, 0, 0), (80, 1, 0), (50, 4, 0), (30, 12, 0), (200, 2, 0), (60, 0, 1), (90, 2, 1), (40, 3, 1)]):
    z = rng.standard_normal((T, dz)); w = np.linspace(0.4, 0.9, dz)
    x = z @ w + rng.standard_normal(T); y = 0.35 * x - z @ w + rng.standard_normal(T)
    if robust: x, y = np.exp(x), y ** 3
    v, p = parcorr(x, y, list(z.T), robust)
    name = "RobustParCorr" if robust else "ParCorr"; id = f"{name.lower()}_{k}"
    write(f"single/{id}.json", dict(id=id, test=dict(name=name, kwargs={}), T=T, dz=dz, x=x.tolist(), y=y.tolist(), z=z.tolist() if dz else None, result=dict(val=v, pval=p)))

T = 150; d = np.zeros((T, 3)); e = rng.standard_normal((T, 3))
for t in range(2, T):
    d[t, 0] = 0.6 * d[t-1, 0] + e[t, 0]
    d[t, 1] = 0.5 * d[t-1, 1] + 0.4 * d[t-1, 0] + e[t, 1]
    d[t, 2] = 0.4 * d[t-1, 2] - 0.5 * d[t-2, 1] + e[t, 2]
os.makedirs(f"{HERE}/data", exist_ok=True)
np.savetxt(f"{HERE}/data/chain.csv", d, fmt="%.17g", delimiter=",", header="A,B,C", comments="")

def pcmci(d, tau_max, pc_alpha, alpha, robust):
    T, N = d.shape; cut = 2 * tau_max
    node = lambda i, lag: d[cut - lag:T - lag, i]
    test = lambda x, j, Z: parcorr(node(*x), node(j, 0), [node(*z) for z in Z], robust)
    parents = {}
    for j in range(N):
        cand = [(i, l) for i in range(N) for l in range(1, tau_max + 1)]; strength = {c: np.inf for c in cand}; p = 0
        while len(cand) - 1 >= p:
            drop = []
            for c in cand:
                v, pv = test(c, j, [o for o in cand if o != c][:p]); strength[c] = min(strength[c], abs(v))
                if pv > pc_alpha: drop.append(c)
            cand = sorted([c for c in cand if c not in drop], key=lambda c: -strength[c]); p += 1
        parents[j] = cand
    val = np.zeros((N, N, tau_max + 1)); pm = np.ones_like(val)
    for j in range(N):
        for i in range(N):
            for l in range(1, tau_max + 1):
                Z = [q for q in parents[j] if q != (i, l)]; Z += [s for s in [(a, b + l) for a, b in parents[i]] if s not in Z]
                val[i, j, l], pm[i, j, l] = test((i, l), j, Z)
    graph = np.where(pm <= alpha, "-->", "")
    return dict(graph=graph.tolist(), val_matrix=val.tolist(), p_matrix=pm.tolist(), pc_stage=dict(all_parents={str(j): [[i, -l] for i, l in parents[j]] for j in parents}))

for name in ("ParCorr", "RobustParCorr"):
    for tau_max in (1, 2):
        id = f"pcmci_{name.lower()}_chain_lag{tau_max}"
        write(f"cases/{id}.json", dict(id=id, method="pcmci", csv=["data/chain.csv"], mask=None, dataframe={}, missing_flag=None, test=dict(name=name, kwargs={}),
              params=dict(tau_min=1, tau_max=tau_max, pc_alpha=0.2, alpha_level=0.05), result=pcmci(d, tau_max, 0.2, 0.05, name == "RobustParCorr")))
