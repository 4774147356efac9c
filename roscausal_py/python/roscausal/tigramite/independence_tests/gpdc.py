"""`GPDC`: dependence with additive noise."""

from __future__ import annotations

from typing import Any

from ..refusal import not_covered
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

    measure, _engine = "gp_dc", "gpdc"

    def __init__(self, null_dist_filename: None = None, gp_params: None = None, **others: Any) -> None:
        not_covered(null_dist_filename=null_dist_filename, gp_params=gp_params)
        super().__init__(**others)
