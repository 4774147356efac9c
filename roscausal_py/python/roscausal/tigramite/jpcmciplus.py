"""`JPCMCIplus`: PCMCI+ on several datasets that may differ."""

from __future__ import annotations

from collections.abc import Mapping
from copy import copy
from typing import Any

from .independence_tests.parcorr_mult import ParCorrMult
from .pcmci import PCMCI, Results
from .refusal import NotCovered



class JPCMCIplus(PCMCI):
    """J-PCMCI+. The arguments are those of `PCMCI`.

    Args:
        node_classification: `{j: "system", "time_context", "space_context", "time_dummy" or "space_dummy"}`. Dummies are the last ones.

    Example:
        >>> import numpy as np
        >>> from roscausal.tigramite import data_processing as pp
        >>> from roscausal.tigramite.independence_tests.parcorr_mult import ParCorrMult
        >>> from roscausal.tigramite.jpcmciplus import JPCMCIplus
        >>> x = np.random.default_rng(1).normal(size=(3, 100, 2))
        >>> x[:, 1:, 1] += x[:, :-1, 0]
        >>> frame = pp.DataFrame(x, analysis_mode="multiple")
        >>> joint = JPCMCIplus({0: "system", 1: "system"}, dataframe=frame, cond_ind_test=ParCorrMult())
        >>> joint.run_jpcmciplus(tau_max=1)["graph"][0, 1].tolist()
        ['', '-->']
    """

    def __init__(self, node_classification: Mapping[int, str], **others: Any) -> None:
        self.node_classification = node_classification
        super().__init__(**others)

    def run_jpcmciplus(self, **settings: Any) -> Results:
        """As `run_pcmciplus`, whose keywords it takes, with contexts and dummies."""
        classes = [self.node_classification[j] for j in range(self.dataframe.N)]
        dummies = [j for j, what in enumerate(classes) if what.endswith("_dummy")]
        if dummies != list(range(len(classes) - len(dummies), len(classes))):
            raise NotCovered("node_classification with a dummy before other variables is not covered by roscausal.tigramite; put it last")
        test = self.cond_ind_test
        try:
            self._classes = classes
            if dummies and isinstance(test, ParCorrMult):
                # The engine's dummies are no columns.
                self.cond_ind_test = copy(test)
                self.cond_ind_test._engine = "parcorr"
            return self.run_pcmciplus(**settings)
        finally:
            self._classes, self.cond_ind_test = (), test
