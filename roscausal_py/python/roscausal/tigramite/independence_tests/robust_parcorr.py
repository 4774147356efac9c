"""`RobustParCorr`: monotone dependence."""

from __future__ import annotations

from .independence_tests_base import CondIndTest


class RobustParCorr(CondIndTest):
    """Partial correlation of normal scores: monotone dependence. The keywords are those of `CondIndTest`.

    Example:
        >>> import numpy as np
        >>> from roscausal.tigramite.independence_tests.robust_parcorr import RobustParCorr
        >>> x = np.arange(60) * 7 % 5
        >>> RobustParCorr().run_test_raw(x, x * x)[1] < 0.05
        True
    """

    measure, _engine = "robust_par_corr", "robustparcorr"
