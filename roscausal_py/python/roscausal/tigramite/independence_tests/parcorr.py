"""`ParCorr`: linear dependence."""

from __future__ import annotations

from .independence_tests_base import CondIndTest


class ParCorr(CondIndTest):
    """Partial correlation: linear dependence. The keywords are those of `CondIndTest`.

    Example:
        >>> import numpy as np
        >>> from roscausal.tigramite.independence_tests.parcorr import ParCorr
        >>> x = np.arange(60) * 7 % 5
        >>> ParCorr().run_test_raw(x, x * x)[1] < 0.05
        True
    """

    measure, _engine = "par_corr", "parcorr"
