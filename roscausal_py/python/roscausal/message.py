"""From a ROS message to a model's JSON."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from ._native import DataError

#: Fields of a model that the message of its settings has under the same name, and under another.
_SAME = ("method", "cond_ind_test", "alpha", "pc_alpha", "dt", "n_samples", "seed")
_OF_INFO = {**{name: name for name in _SAME}, "fdr": "fdr_method", "tau_min": "min_lag", "tau_max": "max_lag"}

#: Most places for links of a message: variables times variables times lags.
_MOST_PLACES = 4_000_000


def text_of(causal_model: Any, info: Any) -> str:
    """The JSON of the model that the message `causal_model` holds."""
    try:
        names = [str(name) for name in causal_model.features]
        shape = tuple(int(length) for length in causal_model.original_shape)
        there = np.array(causal_model.causal_structure.data).reshape(shape).astype(int)
        val = np.array(causal_model.val_matrix.data, dtype=float).reshape(shape)
        pval = np.array(causal_model.pval_matrix.data, dtype=float).reshape(shape)
        n_lags, n, _ = there.shape
    except (AttributeError, ValueError, TypeError) as fault:
        raise DataError(f"this is not a message roscausal_msgs/CausalModel: {fault}") from None
    known = {name: getattr(info, field) for name, field in _OF_INFO.items()} if info is not None else {}
    tau_min = int(known.get("tau_min", 1))
    tau_max = tau_min + n_lags - 1
    cube = (n, n, tau_max + 1)
    if there.shape != (n_lags, len(names), len(names)) or n_lags < 1 or tau_min < 0:
        raise DataError("this is not a message roscausal_msgs/CausalModel: its arrays are not lags x features x features")
    if n * n * (tau_max + 1) > _MOST_PLACES:
        raise DataError(f"a model of {n} variables with lags up to {tau_max} is too large for a message")
    graph, outcomes = np.full(cube, "", dtype="<U3"), np.full(cube, "unknown", dtype="<U9")
    outcomes[:, :, :tau_min] = "not_asked"
    outcomes[range(n), range(n), 0] = "not_asked"
    val_matrix, p_matrix, n_matrix = np.full(cube, None), np.full(cube, None), np.full(cube, None)
    told = {(str(link.cause), str(link.effect), int(link.lag)): link for link in getattr(info, "links", []) if getattr(link, "mark", "")}
    links = []
    for i, j, lag in np.ndindex(n, n, n_lags):
        at, here = (lag, j, i), (i, j, lag + tau_min)
        own = told.get((names[i], names[j], lag + tau_min))
        both = lag + tau_min == 0 and bool(there[lag, i, j])
        if own is None and (not there[at] or (both and (names[j], names[i], 0) in told)):
            continue
        if lag + tau_min == 0 and i == j:
            raise DataError(f"a link of '{names[i]:.80}' to itself at lag 0 cannot be")
        mark = own.mark if own is not None else "o-o" if both else "-->"
        strength = {"value": float(val[at]), "p_value": float(pval[at]), "n_used": None}
        if own is not None:
            strength = {"value": float(own.value), "p_value": float(own.p_value), "n_used": int(own.samples) or None}
            if not own.tested:
                strength = {"value": None, "p_value": None, "n_used": None, "required": True}
        for place, end in ((here, mark), ((j, i, 0), _mirrored(mark))) if here[2] == 0 else ((here, mark),):
            graph[place], outcomes[place] = end, "required" if "required" in strength else "tested"
            val_matrix[place], p_matrix[place], n_matrix[place] = strength["value"], strength["p_value"], strength["n_used"]
        if own is not None or not (both and i > j):
            links.append({"cause": names[i], "effect": names[j], "lag": here[2], **strength, "mark": mark, "n_lost": 0})
    fields = {
        "schema": "roscausal/model/2", "status": "complete", "method": "unknown", "cond_ind_test": "unknown", "alpha": 0.05,
        "pc_alpha": None, "f_alpha": None, "fdr": "none", "tau_min": tau_min, "tau_max": tau_max, "dt": None, "n_samples": 0,
        "n_recordings": 1, "seed": 0, "run_time_s": None, "features": names, "dropped": [], "links": links,
        "graph": graph.tolist(), "outcomes": outcomes.tolist(), "val_matrix": val_matrix.tolist(), "p_matrix": p_matrix.tolist(),
        "n_matrix": n_matrix.tolist(),
        "causal_structure": there.tolist(), "val": val.tolist(), "pval": pval.tolist(), "warnings": [],
    }  # fmt: skip
    if info is None:
        fields["warnings"] = ["the settings are unknown: the message does not hold them"]
    else:
        known["dt"] = known["dt"] or None  # 0: not known
        fields["dropped"] = [str(name) for name in info.candidate_features if str(name) not in names]
    return json.dumps({**fields, **known})


def _mirrored(mark: str) -> str:
    """A mark seen from the other end."""
    return "".join({"<": ">", ">": "<"}.get(end, end) for end in reversed(mark))
