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


@pytest.mark.parametrize("tau_max", [2, 4])
def test_the_data_of_pictures_are_the_references(tau_max):
    theirs, ours = (fitted(package, None, {}, tau_max) for package in ("tigramite", "roscausal.tigramite"))
    for i, j, tau in itertools.product(range(4), range(4), range(1, tau_max + 1)):
        one, other = (med.get_mediation_graph_data(i=i, tau=tau, j=j) for med in (theirs, ours))
        assert one.keys() == other.keys()
        for name in one:
            np.testing.assert_allclose(other[name], one[name], atol=1e-9, err_msg=f"{name} of {i}, {j}, {tau}")


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


def drawn(random):
    """A graph with arrows and hidden causes, X, Y, at times S and a hidden node."""
    graph, order = np.full((7, 7), "", dtype="<U3"), random.permutation(7)
    for later, earlier in itertools.combinations(order[::-1], 2):
        mark = random.choice(["-->", "<->", "+->", ""], p=[0.25, 0.08, 0.03, 0.64])
        graph[earlier, later], graph[later, earlier] = mark, mark[::-1].translate(str.maketrans("<>", "><"))
    nodes = [(int(i), 0) for i in random.permutation(7)]
    causes, effects = random.choice([1, 1, 2]), random.choice([1, 1, 1, 2])
    given = {"X": nodes[:causes], "Y": nodes[causes : causes + effects]}
    given |= {name: [node] for name, node in (("S", nodes[5]), ("hidden_variables", nodes[6])) if random.random() < 0.3}
    return {"graph": graph, "graph_type": "admg", **given}


def adjusted(package, given, seed):
    """All sets, and the effects by two regressors with bootstraps; None where the graph is refused, or the path or a set is missing."""
    linear, near = pytest.importorskip("sklearn.linear_model"), pytest.importorskip("sklearn.neighbors")
    try:
        found = pytest.importorskip(f"{package}.causal_effects").CausalEffects(**given)
    except ValueError:
        return None
    sets = [found.M, found.no_causal_path or found._get_adjust_set()]
    if found.no_causal_path or sets[1] is False:
        return sets, []
    sets += [found.get_optimal_set(minimize=how) for how in (False, "colliders_only")] + list(found.check_XYS_paths())
    random = np.random.default_rng(seed)
    frame = pytest.importorskip(f"{package}.data_processing").DataFrame(np.cumsum(random.normal(size=(300, 7)), axis=1))
    at = {"intervention_data": random.normal(size=(4, len(given["X"])))}
    at |= {"conditions_data": random.normal(size=(4, 1))} if "S" in given else {}
    numbers = []
    for estimator in (linear.LinearRegression(), near.KNeighborsRegressor()):
        how = {"dataframe": frame, "estimator": estimator, "conditional_estimator": linear.LinearRegression()}
        numbers.append(found.fit_total_effect(**how).predict_total_effect(**at))
        found.fit_bootstrap_of("fit_total_effect", how, boot_samples=3, boot_blocklength=2, seed=seed)
        numbers += found.predict_bootstrap_of("predict_total_effect", at, return_individual_bootstrap_results=True)
    return sets, numbers


def test_random_graphs_with_hidden_causes_have_the_references_sets_and_effects():
    adjusting = 0
    for seed in range(200):
        given = drawn(np.random.default_rng(seed))
        ours, theirs = (adjusted(package, given, seed) for package in ("roscausal.tigramite", "tigramite"))
        if ours is None:
            # The reference takes conditions that X drives by way of M.
            continue
        plain = [[value if isinstance(value, bool) else {(int(i), int(lag)) for i, lag in value} for value in of[0]] for of in (ours, theirs)]
        assert plain[0] == plain[1], (seed, given)
        adjusting += bool(ours[1])
        for own, other in zip(ours[1], theirs[1], strict=True):
            np.testing.assert_allclose(own, other, atol=1e-8, err_msg=str(seed))
    assert adjusting >= 20, adjusting


def test_what_lies_before_the_window_is_a_hidden_cause_as_in_the_reference():
    compared = 0
    for seed in range(70):
        random = np.random.default_rng(seed)
        order = random.permutation(3).tolist()
        at_once = {(i, j) for i, j in itertools.combinations(order, 2) if random.random() < 0.25}
        lagged = [(i, j, lag) for i, j, lag in itertools.product(range(3), range(3), (1, 2)) if random.random() < (0.6 if i == j else 0.2)]
        links = {j: [(i, 0) for i in range(3) if (i, j) in at_once] + [(i, -lag) for i, effect, lag in lagged if effect == j] for j in range(3)}
        hidden = [(*random.permutation(3)[:2], int(random.integers(3))) for _ in range(seed % 2)]
        x, y = [(order[0], -int(random.integers(3)))], [(order[int(random.integers(1, 3))], 0)]
        found = []
        for package in ("roscausal.tigramite", "tigramite"):
            module = pytest.importorskip(f"{package}.causal_effects").CausalEffects
            graph = module.get_graph_from_dict(links, tau_max=2)
            for i, j, lag in hidden:
                for pair in [(i, j, lag), (j, i, 0)][: 1 + (lag == 0)]:
                    graph[pair] = graph[pair] or "<->"
            one = module(graph, graph_type="stationary_admg" if hidden else "stationary_dag", X=x, Y=y)
            sets = [] if one.no_causal_path else [one.get_optimal_set(minimize=how) for how in (False, "colliders_only", True)]
            found.append([one.graph.tolist(), [nodes and {(int(i), int(lag)) for i, lag in nodes} for nodes in sets]])
        assert found[0] == found[1], (seed, links, x, y)
        compared += bool(found[0][1])
    assert compared >= 20, compared


@pytest.mark.parametrize("scaled", [False, True])
def test_regressors_on_parents_and_predictions_are_the_references(scaled):
    linear, scaler = (pytest.importorskip(f"sklearn.{name}") for name in ("linear_model", "preprocessing"))
    found = []
    for package in ("roscausal.tigramite", "tigramite"):
        models = pytest.importorskip(f"{package}.models")
        processing = pytest.importorskip(f"{package}.data_processing")
        test = pytest.importorskip(f"{package}.independence_tests.parcorr").ParCorr
        frame = processing.DataFrame(series(), missing_flag=999.0, mask=np.random.default_rng(0).random((400, 4)) < 0.1)
        regressor, given = linear.LinearRegression(), {"data_transform": scaler.StandardScaler() if scaled else None}
        model = models.Models(frame, regressor, mask_type="y", **given)
        fits = model.fit_full_model({**PARENTS, 0: []}, tau_max=3, return_data=True)
        numbers = [fits[j]["data"] for j in range(4)] + model.predict_full_model() + [model.get_val_matrix()]
        whole = processing.DataFrame(series(), missing_flag=999.0)
        pred = models.Prediction(whole, range(300), range(350, 400), regressor, test(), **given)
        causes = pred.get_predictors(steps_ahead=2, tau_max=4, pc_alpha=0.1)
        pred.fit(causes, tau_max=4, return_data=True)
        numbers += [pred.predict([0, 1, 2, 3]), *pred.predict([1, 3]), pred.predict(2)]
        numbers += [pred.get_test_array(2), pred.get_train_array(3), pred.predict([1], new_data=processing.DataFrame(series()[::-1].copy()))]
        found.append((causes, numbers))
    assert found[0][0] == found[1][0] and any(found[0][0].values())
    for own, other in zip(found[0][1], found[1][1], strict=True):
        np.testing.assert_allclose(own, other, atol=1e-8)


@pytest.mark.parametrize("how", ["minimized_optimal", [(0, 0)]])
def test_other_sets_are_taken_and_checked(how):
    ours = pytest.importorskip("roscausal.tigramite.causal_effects").CausalEffects
    regression = pytest.importorskip("sklearn.linear_model").LinearRegression
    frame = pytest.importorskip("roscausal.tigramite.data_processing").DataFrame(series()[:, :3])
    graph = np.array([["", "-->", "-->"], ["<--", "", "-->"], ["<--", "<--", ""]])
    found = ours(graph, graph_type="dag", X=[(1, 0)], Y=[(2, 0)])
    assert found.fit_total_effect(frame, regression(), adjustment_set=how).predict_total_effect([[1.0]]).shape == (1,)
    for bad in ([], [(2, 0)]):
        with pytest.raises(ValueError, match="makes the effect a regression"):
            found.fit_total_effect(frame, regression(), adjustment_set=bad)


def test_what_is_not_covered_is_refused_by_its_name():
    module = pytest.importorskip("roscausal.tigramite.causal_effects")
    ours, models = module.CausalEffects, pytest.importorskip("roscausal.tigramite.models")
    graph = ours.get_graph_from_dict({0: [], 1: [(0, -1)]})
    simple = {"graph": graph, "graph_type": "stationary_dag", "X": [(0, -1)], "Y": [(1, 0)]}
    with pytest.raises(NotImplementedError, match="not covered"):
        ours(**{**simple, "graph_type": "tsg_dag"})
    for name in ("check_optimality", "get_mediators"):
        with pytest.raises(NotImplementedError, match=name):
            getattr(ours(**simple), name)
    one = models.Models(pytest.importorskip("roscausal.tigramite.data_processing").DataFrame(series()), model=None)
    with pytest.raises(NotImplementedError, match="Models.get_residuals_cov_mean"):
        one.get_residuals_cov_mean()
    circle = np.array([["", "-->", "<--"], ["<--", "", "-->"], ["-->", "<--", ""]])
    for given in (
        {"X": [(2, -1)]}, {"X": [(0, 1)]}, {"X": [(1, 0)]}, {"X": []}, {"graph_type": "dag"}, {"S": [(1, 0)]}, {"hidden_variables": [(0, -1)]},
        {"X": (0, -1)}, {"graph": graph[:1]}, {"graph": np.array([["", "-->"], ["", ""]]), "graph_type": "dag", "X": [(0, 0)]},
        {"graph": np.full((2, 2, 2), "o-o")}, {"graph": circle, "graph_type": "dag", "X": [(0, 0)]},
    ):  # fmt: skip
        with pytest.raises(ValueError, match="setting"):
            ours(**{**simple, **given})
