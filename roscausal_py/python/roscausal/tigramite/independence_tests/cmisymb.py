"""`CMIsymb`: dependence of discrete variables."""

from __future__ import annotations

from typing import Any

from ..refusal import not_covered
from .independence_tests_base import CondIndTest


class CMIsymb(CondIndTest):
    """Conditional mutual information of discrete variables, with a shuffle test. The keywords are those of `CondIndTest`.

    Example:
        >>> import numpy as np
        >>> from roscausal.tigramite.independence_tests.cmisymb import CMIsymb
        >>> x = np.arange(60) * 7 % 5
        >>> CMIsymb(sig_samples=100).run_test_raw(x, x)[1] < 0.05
        True
    """

    measure, _engine, _significance, _one_sided = "cmi_symb", "cmisymb", "shuffle_test", True

    def __init__(self, n_symbs: int | None = None, sig_blocklength: int = 1, conf_blocklength: int = 1, **others: Any) -> None:
        not_covered(n_symbs=n_symbs, sig_blocklength=None if sig_blocklength == 1 else sig_blocklength)
        super().__init__(conf_blocklength=conf_blocklength, **others)
