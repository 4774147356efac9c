"""`LinearMediation` and `CausalEffects` here and in tigramite: every number of every function, on the same data."""

import itertools

import numpy as np
import pytest

PARENTS = {0: [(0, -1)], 1: [(0, -1), (0, 0)], 2: [(1, -2), (2, -1)], 3: [(2, 0), (0, -1), (3, -1)]}


def series():
    x = np.random.default_rng(3).normal(size=(400, 4))
    for t in range(2, 400):
        x[t, 0] += 0.5 * x[t - 1, 0]
        x[t, 1] += 0.4 * x[t - 1, 0] - 0.3 * x[t, 0]
        x[t, 2] += 0.5 * x[t - 2, 1] + 0.2 * x[t - 1, 2]
        x[t, 3] += 0.4 * x[t, 2] + 0.3 * x[t - 1, 0] + 0.2 * x[t - 1, 3]
    x *= [1, 2, 3, 0.5]
    x[50, 1] = 999.0
    return x


def fitted(package, mask_type, keywords, tau_max):
    processing = pytest.importorskip(f"{package}.data_processing")
    mask = np.random.default_rng(0).random((400, 4)) < 0.1
    frame = processing.DataFrame(series(), missing_flag=999.0, mask=mask)
    med = pytest.importorskip(f"{package}.models").LinearMediation(frame, mask_type=mask_type, **keywords)
    med.fit_model(PARENTS, tau_max=tau_max)
    med.fit_model_bootstrap(boot_blocklength=2, seed=7, boot_samples=10)
    return med


def questions(tau_max):
    yield from (("get_val_matrix", {"symmetrize": both}) for both in (False, True))
    for i, j in itertools.permutations(range(4), 2):
        yield from (("get_ce_max", {"i": i, "j": j}), ("get_joint_ce", {"i": i, "j": j}))
        for tau, k in itertools.product(range(tau_max + 1), range(4)):
            yield from (("get_ce", {"i": i, "tau": -tau, "j": j}), ("get_coeff", {"i": i, "tau": tau, "j": j}))
            yield "get_mce", {"i": i, "tau": -tau, "j": j, "k": k}
            yield "get_conditional_mce", {"i": i, "tau": -tau, "j": j, "k": k, "notk": (k + 1) % 4}
            if k not in (i, j):
                yield "get_joint_mce", {"i": i, "j": j, "k": k}
    for mode, alone, self_effects in itertools.product(("absmax", "all_lags"), (True, False), (True, False)):
        yield from (("get_all_ace", {"lag_mode": mode, "exclude_i": alone}), ("get_ace", {"i": 1, "lag_mode": mode, "exclude_i": alone}))
        yield from (("get_all_acs", {"lag_mode": mode, "exclude_j": alone}), ("get_acs", {"j": 2, "lag_mode": mode, "exclude_j": alone}))
        how = {"lag_mode": mode, "exclude_k": alone, "exclude_self_effects": self_effects}
        yield from (("get_all_amce", how), ("get_amce", {"k": 2, **how}))
    for name, given in (("get_ce", {"i": 0, "tau": -1, "j": 3}), ("get_all_amce", {})):
        yield "get_bootstrap_of", {"function": name, "function_args": given}


@pytest.mark.parametrize("mask_type", [None, "y", "xz"])
@pytest.mark.parametrize("keywords", [{}, {"data_transform": None}])
@pytest.mark.parametrize("tau_max", [None, 5])
def test_every_number_is_the_references(mask_type, keywords, tau_max):
    theirs, ours = (fitted(package, mask_type, keywords, tau_max) for package in ("tigramite", "roscausal.tigramite"))
    np.testing.assert_allclose(ours.phi, theirs.phi, atol=1e-10)
    np.testing.assert_allclose(ours.all_psi_k, theirs.all_psi_k, atol=1e-10)
    assert {j: list(of) for j, of in ours.get_coefs().items()} == {j: list(of) for j, of in theirs.get_coefs().items()}
    for name, given in questions(ours.tau_max):
        np.testing.assert_allclose(getattr(ours, name)(**given), getattr(theirs, name)(**given), atol=1e-10, err_msg=f"{name} {given}")


def effects(package, x, y, graph_type="stationary_dag"):
    module = pytest.importorskip(f"{package}.causal_effects")
    graph = module.CausalEffects.get_graph_from_dict({j: [(node, 0.3, None) for node in of] for j, of in PARENTS.items()})
    if graph_type == "dag":
        graph = graph[:, :, 0]
    return module.CausalEffects(graph, graph_type=graph_type, X=x, Y=y)


@pytest.mark.parametrize(
    ("x", "y", "graph_type"),
    [
        ([(1, -2)], [(3, 0)], "stationary_dag"),
        ([(0, -1)], [(3, 0)], "stationary_dag"),
        ([(0, -3)], [(2, 0)], "stationary_dag"),
        ([(0, -1), (1, -2)], [(3, 0)], "stationary_dag"),
        ([(3, -1)], [(1, 0)], "stationary_dag"),
        ([(0, 0)], [(1, 0)], "dag"),
        ([(2, 0)], [(3, 0)], "dag"),
    ],
)
def test_every_effect_is_the_references(x, y, graph_type):
    regression = pytest.importorskip("sklearn.linear_model").LinearRegression
    at, answers = np.random.default_rng(1).normal(size=(5, len(x))), []
    for package in ("tigramite", "roscausal.tigramite"):
        frame = pytest.importorskip(f"{package}.data_processing").DataFrame(series(), missing_flag=999.0)
        found = effects(package, x, y, graph_type)
        answer = [found.no_causal_path, {(int(i), int(lag)) for i, lag in found.M}]
        if not found.no_causal_path:
            answer.append({(int(i), int(lag)) for i, lag in found.get_optimal_set()})
            answer.append(found.fit_total_effect(frame, regression()).predict_total_effect(at).tolist())
        for mediation in (None, "direct", *([node] for node in sorted(answer[1])), sorted(answer[1])[:2] or None):
            answer.append(found.fit_wright_effect(frame, mediation=mediation).predict_wright_effect(at).tolist())
        answers.append(answer)
    theirs, ours = answers
    sets = 2 if ours[0] else 3
    assert ours[:sets] == theirs[:sets]
    for own, other in zip(ours[sets:], theirs[sets:], strict=True):
        np.testing.assert_allclose(own, other, atol=1e-8)


def test_what_is_not_covered_is_refused_by_its_name():
    ours = pytest.importorskip("roscausal.tigramite.causal_effects").CausalEffects
    graph = ours.get_graph_from_dict({0: [], 1: [(0, -1)]})
    for given in ({"S": [(0, -2)]}, {"graph_type": "stationary_admg"}, {"Y": [(0, 0), (1, 0)]}, {"hidden_variables": [(0, -1)]}):
        with pytest.raises(NotImplementedError, match="not covered"):
            ours(graph, **{"graph_type": "stationary_dag", "X": [(0, -1)], "Y": [(1, 0)], **given})
    for given in ({"X": [(2, -1)]}, {"X": [(0, 1)]}, {"X": [(1, 0)]}, {"graph_type": "dag"}):
        with pytest.raises(ValueError, match="setting"):
            ours(graph, **{"graph_type": "stationary_dag", "X": [(0, -1)], "Y": [(1, 0)], **given})
