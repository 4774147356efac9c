"""`GPDC`: dependence with additive noise."""

from __future__ import annotations

from .independence_tests_base import CondIndTest


class GPDC(CondIndTest):
    """Gaussian processes and distance correlation: dependence with additive noise. The keywords are those of `CondIndTest`.

    Example:
        >>> import numpy as np
        >>> from roscausal.tigramite.independence_tests.gpdc import GPDC
        >>> x = np.arange(60) * 7 % 5
        >>> GPDC().run_test_raw(x, x * x)[1] < 0.05
        True
    """

    measure, _engine, _one_sided = "gp_dc", "gpdc", True
    _fixed = {"null_dist_filename": None, "gp_params": None}
