"""`RegressionCI`: linear dependence of numbers and categories."""

from __future__ import annotations

import numpy as np

from ..data_processing import DataFrame
from ..refusal import NotCovered
from .independence_tests_base import CondIndTest


class RegressionCI(CondIndTest):
    """Likelihood ratios of regressions: dependence of numbers and categories. The keywords are those of `CondIndTest`.

    Example:
        >>> import numpy as np
        >>> from roscausal.tigramite.independence_tests.regressionCI import RegressionCI
        >>> x = np.random.default_rng(1).normal(size=60)
        >>> RegressionCI().run_test_raw(x, x > 0)[1] < 0.05
        True
    """

    measure, _engine, _one_sided = "regression_ci", "regressionci", True

    def _check(self, frame: DataFrame) -> None:
        # The engine takes up to ten different whole numbers for categories; what the user says must agree.
        for key, types in (frame.data_type or {}).items():
            for column, (values, kinds) in enumerate(zip(frame.values[key].T, types.T)):
                seen = np.unique(values[np.isfinite(values)])
                if set(kinds) != {int(len(seen) <= 10 and bool(np.all(seen == np.round(seen))))}:
                    raise NotCovered(
                        f"data_type {set(kinds.tolist())} of column {column} of dataset {key} is not covered by roscausal.tigramite: up to "
                        "ten different whole numbers are categories (1), all else numbers (0); change the codes"
                    )
