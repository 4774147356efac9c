"""`ParCorr`: linear dependence."""

from __future__ import annotations

from .independence_tests_base import CondIndTest


class ParCorr(CondIndTest):
    """Partial correlation: linear dependence. The keywords are those of `CondIndTest`.

    Raises:
        SettingError: A keyword or value that this test does not have.

    Example:
        >>> import numpy as np
        >>> from roscausal.tigramite.independence_tests.parcorr import ParCorr
        >>> x = np.arange(60) * 7 % 5
        >>> value, p = ParCorr().run_test_raw(x, x * x)
        >>> p < 0.05
        True
    """

    measure = "par_corr"
    _engine = "parcorr"
