"""`ParCorrWLS`: linear dependence where the noise grows and shrinks over time."""

from __future__ import annotations

from typing import Any

from ..refusal import not_covered
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

    def __init__(
        self, gt_std_matrix: None = None, expert_knowledge: str = "time-dependent heteroskedasticity", window_size: int = 10,
        robustify: bool = False, **others: Any,
    ) -> None:  # fmt: skip
        over_time = expert_knowledge == "time-dependent heteroskedasticity"
        not_covered(
            gt_std_matrix=gt_std_matrix, robustify=robustify, expert_knowledge=None if over_time else expert_knowledge,
            window_size=None if window_size == 10 else window_size,
        )  # fmt: skip
        super().__init__(**others)
