"""The reference implementation's classes under their own names: a program that uses tigramite changes its imports only.

>>> import numpy as np
>>> from roscausal.tigramite import data_processing as pp
>>> from roscausal.tigramite.independence_tests.parcorr import ParCorr
>>> from roscausal.tigramite.pcmci import PCMCI
>>> x = np.random.default_rng(1).normal(size=(300, 2))
>>> x[1:, 1] += x[:-1, 0]
>>> pcmci = PCMCI(dataframe=pp.DataFrame(x, var_names=["a", "b"]), cond_ind_test=ParCorr())
>>> results = pcmci.run_pcmci(tau_min=1, tau_max=2, pc_alpha=0.2)
>>> str(results["graph"][0, 1, 1]), results["p_matrix"].shape
('-->', (2, 2, 3))

Names, defaults, shapes and keys are tigramite's (5.2). What is not covered raises `NotImplementedError` with its name.
"""

import sys
from importlib.abc import MetaPathFinder
from typing import Any

from .refusal import missing


class _Modules(MetaPathFinder):
    """Asked last: a module of tigramite that is not here is refused by its name."""

    def find_spec(self, fullname: str, path: Any = None, target: Any = None) -> None:
        """Refuses it."""
        parent, _, name = fullname.rpartition(".")
        if parent.startswith(__name__) and not name.startswith("_"):
            missing(parent, name)(name)


sys.meta_path.append(_Modules())
