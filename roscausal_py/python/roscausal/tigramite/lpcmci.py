"""`LPCMCI`: links where common causes may be hidden."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from .pcmci import PCMCI, Results, _engines
from .refusal import not_covered, unknown
from .results import Links

#: Keywords that choose what the engine always does.
_FIXED = {
    "parents_of_lagged": True, "prelim_only": False, "break_once_separated": True, "use_a_pds_t_for_majority": True,
    "orient_contemp": 1, "update_middle_marks": True, "prelim_rules": 1, "fix_all_edges_before_final_orientation": True,
    "auto_first": True, "remember_only_parents": True, "no_apr": 0,
}  # fmt: skip


class LPCMCI(PCMCI):
    """LPCMCI. The arguments are those of `PCMCI`.

    Example:
        >>> import numpy as np
        >>> from roscausal.tigramite import data_processing as pp
        >>> from roscausal.tigramite.independence_tests.parcorr import ParCorr
        >>> from roscausal.tigramite.lpcmci import LPCMCI
        >>> x = np.random.default_rng(1).normal(size=(300, 2))
        >>> x[1:, 1] += x[:-1, 0]
        >>> LPCMCI(pp.DataFrame(x), ParCorr()).run_lpcmci(tau_max=1)["graph"][0, 1].tolist()
        ['', 'o->']
    """

    def run_lpcmci(
        self, link_assumptions: Links | None = None, tau_min: int = 0, tau_max: int = 1, pc_alpha: float = 0.05,
        n_preliminary_iterations: int = 1, max_cond_px: int = 0, max_p_global: float = math.inf,
        max_p_non_ancestral: float = math.inf, max_q_global: float = math.inf, max_pds_set: float = math.inf,
        prelim_with_collider_rules: bool = True, no_non_ancestral_phase: bool = False, **fixed: Any,
    ) -> Results:  # fmt: skip
        """LPCMCI: `graph` with marks such as o->, <->, `p_matrix` (the largest of a link's tests) and `val_matrix`.

        Args:
            link_assumptions: `{j: {(i, -lag): mark}}` with marks -?>, -->, <?>, <->, o?>, o->, at lag 0 also o?o, o-o.
            n_preliminary_iterations: How often causes are learnt beforehand.
            fixed: The reference's other keywords, with its defaults only.
        """
        given = locals()
        unknown("run_lpcmci", {name: None for name in fixed if name not in _FIXED}, _FIXED)
        not_covered(**{name: f"{value!r}" for name, value in fixed.items() if value != _FIXED[name]})
        settings = {**_engines(given), "non_ancestral_phase": not no_non_ancestral_phase}
        for name in ("max_p_global", "max_p_non_ancestral", "max_q_global", "max_pds_set"):
            settings[name] = None if math.isinf(given[name]) else int(given[name])
        found = self._matrices(self._run("lpcmci", settings, link_assumptions), pc_alpha)
        found["p_matrix"][np.arange(self.N), np.arange(self.N), 0] = 0.0
        return {name: found[name] for name in ("graph", "p_matrix", "val_matrix")}
