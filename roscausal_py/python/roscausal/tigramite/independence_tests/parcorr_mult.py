"""`ParCorrMult`: linear dependence of vectors."""

from __future__ import annotations

from typing import Any

from ..refusal import not_covered
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

    def __init__(self, correlation_type: str = "max_corr", **others: Any) -> None:
        not_covered(correlation_type=None if correlation_type == "max_corr" else correlation_type)
        super().__init__(**others)
