"""`RobustParCorr`: monotone dependence."""

from __future__ import annotations

from .independence_tests_base import CondIndTest


class RobustParCorr(CondIndTest):
    """Partial correlation of normal scores: monotone dependence. The keywords are those of `CondIndTest`.

    Raises:
        SettingError: A keyword or value that this test does not have.

    Example:
        >>> import numpy as np
        >>> from roscausal.tigramite.independence_tests.robust_parcorr import RobustParCorr
        >>> x = np.arange(60) * 7 % 5
        >>> value, p = RobustParCorr().run_test_raw(x, x * x)
        >>> p < 0.05
        True
    """

    measure = "robust_par_corr"
    _engine = "robustparcorr"
