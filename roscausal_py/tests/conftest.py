"""What the tests share: data in which `a` drives `b` one step later, and places in the repository."""

import pathlib

import numpy as np
import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]


@pytest.fixture
def chain():
    """(300, 3): a -> b -> c, one step each."""
    x = np.random.default_rng(7).normal(size=(300, 3))
    for t in range(1, 300):
        x[t, 1] += 0.8 * x[t - 1, 0]
        x[t, 2] += 0.8 * x[t - 1, 1]
    return x


@pytest.fixture
def quick():
    """Settings of a fast analysis."""
    return {"method": "pcmci", "test": "parcorr", "tau_max": 2}
