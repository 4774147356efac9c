"""`CMIknn`: dependence of any form."""

from __future__ import annotations

from typing import Any

from ..refusal import not_covered
from .independence_tests_base import CondIndTest


class CMIknn(CondIndTest):
    """Conditional mutual information by nearest neighbours: dependence of any form, with a local permutation test.

    Args:
        knn: Neighbours; below 1: a fraction of the samples.
        shuffle_neighbors: Neighbours in Z among which is permuted.
        significance: "shuffle_test" or "fixed_thres".
        transform: "ranks", "uniform", "standardize" or False.
        workers: Ignored; a run uses all cores, and they do not change its result.
        others: Those of `CondIndTest`.

    Raises:
        NotImplementedError: `null_fit`, another `permute` than "Y".

    Example:
        >>> import numpy as np
        >>> from roscausal.tigramite.independence_tests.cmiknn import CMIknn
        >>> x = np.sin(np.arange(80.0) ** 2)
        >>> CMIknn(sig_samples=100).run_test_raw(x, x * x)[1] < 0.05
        True
    """

    measure, _engine, _significance, _one_sided = "cmi_knn", "cmiknn", "shuffle_test", True

    def __init__(
        self, knn: float = 0.2, shuffle_neighbors: int = 5, significance: str = "shuffle_test",
        transform: str | bool | None = "ranks", workers: int = -1, model_selection_folds: int = 3, null_fit: None = None,
        permute: str = "Y", **others: Any,
    ) -> None:  # fmt: skip
        not_covered(null_fit=null_fit, permute=None if permute == "Y" else permute)
        self.knn, self.shuffle_neighbors = knn, shuffle_neighbors
        self.transform, self.workers = transform, workers
        super().__init__(significance=significance, **others)

    def _own(self) -> dict[str, Any]:
        transform = self.transform if isinstance(self.transform, str) else "none"
        return {"knn": self.knn, "shuffle_neighbors": self.shuffle_neighbors, "transform": transform}
