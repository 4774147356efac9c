"""How much of what GPDC finds in the demo comes from fits that outliers pull (docs/paper.md).

A risk that leaps for two samples when the person meets the robot, and a distance that leaps at each new goal, are outliers of their
regressions. A Gaussian process takes them for noise, fits all other rows less well, and what is left of a condition in both residuals
makes them depend on each other. Here each link is tested in stretches of 1000 rows twice: with residuals of a Gaussian process as GPDC has
them (kernel exp(-d^2 / 2 l^2), noise s, largest likelihood over l and s, the amplitude 1), and with those of a fit that draws targets
further than 2.5 deviations (by the median of the absolute residuals) back to there, three times.

    roscausal demo --seed 1001 --duration 6006 --method pcmci --test parcorr --out long
    OMP_NUM_THREADS=1 python benches/outliers.py long/pp_pool/analysed/*.csv

Needs numpy and pandas. Prints for each link in how many stretches it is found at level 0.05. Half an hour for 20 stretches on one core.
"""

import sys

import numpy as np
import pandas as pd

ROWS, NOISES, LENGTHS = 1000, np.geomspace(3e-4, 4, 40), np.geomspace(0.2, 20, 12)
CRITICAL = 5.25  # of (n - 1) times the squared distance correlation of ranks, at 0.05
V, G, R = range(3)
# effect, cause, parents of the effect beside the cause, parents of the cause; one sample before each
LINKS = {
    "h_dg -> h_risk (absent)": (R, G, [R, V], [G, V]), "h_risk -> h_dg (absent)": (G, R, [G, V], [R, V]),
    "h_risk -> h_v": (V, R, [V, G], [R, V]), "h_dg -> h_v": (V, G, [V, R], [G, V]),
}


def spectra(conditions):
    z = (conditions - conditions.mean(0)) / conditions.std(0)
    squares = ((z[:, None] - z[None]) ** 2).sum(2)
    return [np.linalg.eigh(np.exp(-0.5 * squares / length**2)) for length in LENGTHS]


def fitted(kernels, y):
    best = (-np.inf, None)
    for values, vectors in kernels:
        along, values = vectors.T @ y, np.maximum(values, 0)
        for noise in NOISES:
            likelihood = -0.5 * (along**2 / (values + noise)).sum() - 0.5 * np.log(values + noise).sum()
            if likelihood > best[0]:
                best = (likelihood, vectors @ (values / (values + noise) * along))
    return best[1]


def residuals(kernels, y, robust):
    y = (y - y.mean()) / y.std()
    left = y - fitted(kernels, y)
    for _ in range(3 if robust else 0):
        middle = np.median(left)
        reach = 2.5 * 1.4826 * np.median(abs(left - middle))
        drawn = y - left + middle + np.clip(left - middle, -reach, reach)
        mean, deviation = drawn.mean(), drawn.std()
        left = y - mean - deviation * fitted(kernels, (drawn - mean) / deviation)
    return left


def distance_correlation(a, b):
    def centred(series):
        ranks = pd.Series(series).rank().values
        apart = abs(ranks[:, None] - ranks[None])
        means = apart.mean(1)
        return apart - means[:, None] - means[None] + means.mean()

    a, b = centred(a), centred(b)
    return (a * b).sum() / np.sqrt((a * a).sum() * (b * b).sum())


rows = pd.concat([pd.read_csv(name) for name in sys.argv[1:]])[["h_v", "h_dg", "h_risk"]].values
stretches = [rows[at : at + ROWS] for at in range(0, len(rows) - ROWS + 1, ROWS)]
found = {link: [0, 0] for link in LINKS}
for stretch in stretches:
    stretch = stretch[~np.isnan(stretch).any(1)]
    for link, (effect, cause, of_effect, of_cause) in LINKS.items():
        kernels = spectra(np.column_stack([stretch[1:-1, of_effect], stretch[:-2, of_cause]]))
        for robust in (False, True):
            left = [residuals(kernels, y, robust) for y in (stretch[2:, effect], stretch[1:-1, cause])]
            found[link][robust] += (len(left[0]) - 1) * distance_correlation(*left) > CRITICAL
for link, (plain, robust) in found.items():
    print(f"{link}: {plain} of {len(stretches)}, with a fit that outliers do not pull {robust}")
