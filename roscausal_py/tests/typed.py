"""A user's script: `mypy --strict` must find nothing in it."""

from collections.abc import Sequence

import numpy as np
import roscausal as rc
from numpy.typing import NDArray
from roscausal.tigramite import data_processing as pp
from roscausal.tigramite.independence_tests.parcorr import ParCorr
from roscausal.tigramite.pcmci import PCMCI


def strongest(data: NDArray[np.float64], names: Sequence[str]) -> rc.Link:
    """The strongest link of the data."""
    model: rc.Model = rc.discover(data, columns=names, method="pcmci", test="parcorr", alpha=0.01, progress=lambda done, total: None)
    matrix: NDArray[np.float64] = model.val_matrix
    assert matrix.shape[2] == 2
    return max(model.links, key=lambda link: abs(link.value or 0))


def mark(data: NDArray[np.float64]) -> str:
    """The mark of the first pair at lag 1."""
    pcmci = PCMCI(pp.DataFrame(data), ParCorr(significance="analytic"))
    return str(pcmci.run_pcmci(tau_max=1, pc_alpha=0.2)["graph"][0, 1, 1])


noise: NDArray[np.float64] = np.random.default_rng(1).normal(size=(200, 2))
noise[1:, 1] += noise[:-1, 0]
link: rc.Link = strongest(noise, ["a", "b"])
cause: str = link.cause
assert (cause, mark(noise)) == ("a", "-->")
