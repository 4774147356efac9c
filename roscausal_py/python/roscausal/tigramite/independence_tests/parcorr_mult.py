"""`ParCorrMult`: linear dependence of vectors."""

from __future__ import annotations

from .independence_tests_base import CondIndTest


class ParCorrMult(CondIndTest):
    """Largest partial correlation of the components of two vectors. The keywords are those of `CondIndTest`.

    Example:
        >>> import numpy as np
        >>> from roscausal.tigramite.independence_tests.parcorr_mult import ParCorrMult
        >>> x = np.random.default_rng(1).normal(size=(60, 2))
        >>> ParCorrMult().run_test_raw(x, x.sum(axis=1))[1] < 0.05
        True
    """

    measure, _engine = "par_corr_mult", "parcorrmult"
    _fixed = {"correlation_type": "max_corr"}
