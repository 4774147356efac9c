"""`ParCorrWLS`: linear dependence where the noise grows and shrinks over time."""

from __future__ import annotations

from .independence_tests_base import CondIndTest


class ParCorrWLS(CondIndTest):
    """Partial correlation by weighted least squares, the weights from windows of 10 times. The keywords are those of `CondIndTest`.

    Example:
        >>> import numpy as np
        >>> from roscausal.tigramite.independence_tests.parcorr_wls import ParCorrWLS
        >>> x = np.arange(60) * 7 % 5
        >>> ParCorrWLS().run_test_raw(x, x * x)[1] < 0.05
        True
    """

    measure, _engine = "par_corr_wls", "parcorrwls"
    _fixed = {
        "gt_std_matrix": None, "expert_knowledge": "time-dependent heteroskedasticity", "window_size": 10, "robustify": False,
    }  # fmt: skip
