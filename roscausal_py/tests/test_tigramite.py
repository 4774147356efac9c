"""The classes of `roscausal.tigramite`: return values, refusals, windows, several datasets, tests of one's own."""

import copy
import importlib
import pickle

import numpy as np
import pytest

import roscausal as rc
from roscausal.tigramite import data_processing as pp
from roscausal.tigramite.independence_tests.cmiknn import CMIknn
from roscausal.tigramite.independence_tests.gpdc import GPDC
from roscausal.tigramite.independence_tests.parcorr import ParCorr
from roscausal.tigramite.independence_tests.oracle_conditional_independence import OracleCI
from roscausal.tigramite.independence_tests.parcorr_mult import ParCorrMult
from roscausal.tigramite.independence_tests.regressionCI import RegressionCI
from roscausal.tigramite.jpcmciplus import JPCMCIplus
from roscausal.tigramite.lpcmci import LPCMCI
from roscausal.tigramite.pcmci import PCMCI
from roscausal.tigramite.toymodels import structural_causal_processes as toys


@pytest.fixture
def pcmci(chain):
    return PCMCI(dataframe=pp.DataFrame(chain, var_names=["a", "b", "c"]), cond_ind_test=ParCorr(significance="analytic"))


def test_a_result_has_the_references_keys_shapes_and_types(pcmci):
    results = pcmci.run_pcmci(tau_min=1, tau_max=5, pc_alpha=0.2)
    assert list(results) == ["graph", "p_matrix", "val_matrix", "conf_matrix"]
    assert results["graph"].dtype == np.dtype("<U3") and results["graph"].shape == (3, 3, 6)
    assert results["val_matrix"].dtype == results["p_matrix"].dtype == np.float64
    assert results["graph"][0, 1, 1] == "-->" and results["conf_matrix"] is None
    assert (0, -1) in pcmci.all_parents[1] and set(pcmci.val_min[1]) == set(pcmci.all_parents[1])
    assert set(pcmci.pval_max[1]) == {(i, -lag) for i in range(3) for lag in range(1, 6)}
    plus = pcmci.run_pcmciplus(tau_max=1)
    assert {"sepsets", "ambiguous_triples"} <= set(plus) and ((0, -1), 2) in plus["sepsets"]


def test_the_defaults_are_the_references_and_not_ours(pcmci, chain):
    assert pcmci.run_pcmci()["graph"].shape[2] == 2
    assert np.any(pcmci.run_pcmci()["p_matrix"][:, :, 0] < 1), "tau_min is 0"
    ours = rc.discover(chain, method="pcmci", test="parcorr", tau_min=0, tau_max=1)
    assert np.array_equal(np.nan_to_num(ours.p_matrix, nan=1.0), pcmci.run_pcmci()["p_matrix"])


def test_a_run_is_its_two_halves(pcmci):
    whole = pcmci.run_pcmci(tau_min=1, tau_max=2)
    halves = pcmci.run_mci(tau_min=1, tau_max=2, parents=pcmci.run_pc_stable(tau_max=2))
    assert all(np.array_equal(whole[name], halves[name]) for name in ("graph", "p_matrix", "val_matrix"))


def test_what_is_not_covered_is_refused_by_its_name(pcmci, chain):
    for call, name in [
        (lambda: pcmci.run_bootstrap_of("run_pcmci", {}, aggregation="weighted"), "weighted"),
        (lambda: pcmci.run_pcmci(selected_links={}), "selected_links"),
        (lambda: pp.DataFrame(chain, vector_vars={0: [(0, -1)]}), "vector_vars"),
        (lambda: pp.DataFrame(chain).print_array_info, "print_array_info"),
        (lambda: importlib.import_module("roscausal.tigramite.plotting"), "tigramite.plotting takes our frames and results"),
        (lambda: importlib.import_module("roscausal.tigramite.toymodels.context_model"), "toymodels.context_model"),
        (lambda: pp.smooth, "tigramite.data_processing.smooth"),
        (lambda: PCMCI(pp.DataFrame(chain), Mine()).run_pcmci(), "Mine.get_dependence_measure"),
        (lambda: LPCMCI(pp.DataFrame(chain), ParCorr()).run_lpcmci(prelim_only=True), "prelim_only"),
        (lambda: ParCorr(fixed_thres=0.1), "fixed_thres"),
        (lambda: ParCorr().get_shuffle_significance, "get_shuffle_significance"),
    ]:
        with pytest.raises(NotImplementedError, match=name):
            call()
    assert not hasattr(pcmci, "run_lpcmci")


def test_unknown_keywords_are_refused_with_the_nearest(chain):
    with pytest.raises(rc.SettingError, match="significance"):
        ParCorr(significanse="analytic")
    with pytest.raises(rc.SettingError, match="missing_flag"):
        pp.DataFrame(chain, missing_flags=999)
    for settings in ({"significance": "exact"}, {"sig_samples": 0}, {"confidence": "none"}):
        with pytest.raises(rc.SettingError):
            ParCorr(**settings)
    with pytest.raises(rc.SettingError, match="there twice"):
        pp.DataFrame(chain, var_names=["a", "a", "b"])
    with pytest.raises(rc.SettingError, match="reference_points"):
        pp.DataFrame(chain, reference_points=[300])
    with pytest.raises(rc.DataError, match="mask"):
        pp.DataFrame(chain, mask=np.zeros((3, 3)))


def test_a_flag_marks_missing_values_and_a_mask_excluded_ones(chain):
    flagged = np.where(np.arange(300)[:, None] % 50 == 3, 999.0, chain)
    nan = np.where(flagged == 999.0, np.nan, flagged)
    runs = [PCMCI(frame, ParCorr()).run_pcmci() for frame in (pp.DataFrame(flagged, missing_flag=999.0), pp.DataFrame(nan))]
    assert np.array_equal(runs[0]["val_matrix"], runs[1]["val_matrix"])
    mask = np.zeros(chain.shape, dtype=bool)
    mask[:150] = True
    half = PCMCI(pp.DataFrame(chain, mask=mask), ParCorr(mask_type="y")).run_pcmci(tau_max=1)
    points = PCMCI(pp.DataFrame(chain, reference_points=np.arange(150, 300)), ParCorr()).run_pcmci(tau_max=1)
    assert np.allclose(half["val_matrix"], points["val_matrix"])
    ignored = PCMCI(pp.DataFrame(chain, mask=mask), ParCorr()).run_pcmci(tau_max=1)
    assert not np.allclose(half["val_matrix"], ignored["val_matrix"])


def test_every_layout_of_an_array_gives_the_same_numbers(chain, pcmci):
    values = pcmci.run_pcmci(tau_max=2)["val_matrix"]
    readonly = chain.copy()
    readonly.flags.writeable = False
    for array in (np.asfortranarray(chain), chain.astype(">f8"), readonly, np.repeat(chain, 2, axis=0)[::2]):
        assert np.array_equal(PCMCI(pp.DataFrame(array), ParCorr()).run_pcmci(tau_max=2)["val_matrix"], values)
    single = PCMCI(pp.DataFrame(chain.astype(np.float32)), ParCorr()).run_pcmci(tau_max=2)["val_matrix"]
    assert np.allclose(single, values, atol=1e-6) and single.dtype == np.float64
    for shape in ((300,), (3, 4, 5), (0, 3)):
        with pytest.raises(ValueError):
            PCMCI(pp.DataFrame(np.zeros(shape)), ParCorr()).run_pcmci()


def test_datasets_with_offsets_share_reference_points(chain):
    parts = {"x": chain[:150], "y": chain[150:]}
    frame = pp.DataFrame(parts, analysis_mode="multiple", time_offsets={"x": 0, "y": 150}, reference_points=np.arange(2, 150))
    first = PCMCI(frame, ParCorr()).run_pcmci(tau_max=1)
    alone = PCMCI(pp.DataFrame(chain[:150]), ParCorr()).run_pcmci(tau_max=1)
    assert np.allclose(first["val_matrix"], alone["val_matrix"])


def test_windows_use_their_samples_and_the_past_before_them(chain, pcmci):
    found = pcmci.run_sliding_window_of("run_pcmci", {"tau_max": 1}, window_step=100, window_length=100)
    assert found["window_results"]["graph"].shape == (2, 3, 3, 2)
    points = PCMCI(pp.DataFrame(chain, reference_points=np.arange(100, 200)), ParCorr()).run_pcmci(tau_max=1)
    assert np.array_equal(found["window_results"]["val_matrix"][1], points["val_matrix"])
    assert pcmci.run_pcmci()["graph"].shape == (3, 3, 2), "the windows are over"
    with pytest.raises(rc.SettingError, match="window_length"):
        pcmci.run_sliding_window_of("run_pcmci", {}, window_step=1, window_length=300)


@pytest.mark.parametrize(
    ("marks", "mark", "share"),
    [
        (["", "", "o-o"], "", 2 / 3),
        (["", "-->"], "", 1.0),
        (["-->", "<--"], "x-x", 1.0),
        (["-->", "o-o"], "o-o", 1.0),
        (["o-o", "x-x"], "x-x", 1.0),
        (["", "-->", "-->", "<--", "<--"], "x-x", 0.8),
    ],
)
def test_ties_of_many_runs_are_settled_as_by_the_reference(marks, mark, share):
    graph = np.array(marks, dtype="<U3").reshape(-1, 1, 1, 1)
    summary = PCMCI.return_summary_results({"graph": graph, "val_matrix": np.zeros(graph.shape)})
    assert summary["most_frequent_links"].item() == mark
    assert summary["link_frequency"].item() == pytest.approx(share)


def test_a_correction_of_pcmciplus_leaves_the_graph_as_in_the_reference():
    rng = np.random.default_rng(2)
    x = rng.normal(size=(300, 5))
    for t in range(1, 300):
        x[t] += 0.3 * x[t - 1]
        x[t, 1] += 0.2 * x[t - 1, 0]
        x[t, 3] += 0.15 * x[t - 1, 2]
    # Links and their largest p-value in tigramite 5.2.10.1.
    for fdr_method, largest in (("none", 0.013290491190654473), ("fdr_bh", 0.09493207993324622)):
        found = PCMCI(pp.DataFrame(x.copy()), ParCorr()).run_pcmciplus(tau_max=2, pc_alpha=0.05, fdr_method=fdr_method)
        is_link = found["graph"] != ""
        assert is_link.sum() == 7 and found["p_matrix"][is_link].max() == pytest.approx(largest, rel=1e-9)


def test_tests_say_whether_a_threshold_holds_for_the_size_of_the_value():
    assert ParCorr().two_sided and not any(kind().two_sided for kind in (GPDC, CMIknn, RegressionCI)), "as PairwiseMultCI asks"


def test_single_tests_say_value_p_value_and_decision(chain):
    test = ParCorr()
    test.set_dataframe(pp.DataFrame(chain))
    value, p = test.run_test([(0, -1)], [(1, 0)], [(1, -1)], tau_max=1)
    assert test.run_test([(0, -1)], [(1, 0)], [(1, -1)], tau_max=1, alpha_or_thres=0.05) == (value, p, True)
    assert test.get_measure([(0, -1)], [(1, 0)], [(1, -1)], tau_max=1) == value
    array, _, _ = pp.DataFrame(chain).construct_array([(0, -1)], [(1, 0)], [(1, -1)], tau_max=1)
    assert ParCorr().run_test_raw(array[:1].T, array[1], array[2:].T)[0] == pytest.approx(value, rel=1e-12)
    fixed = ParCorr(significance="fixed_thres")
    assert fixed.run_test_raw(array[0], array[1], alpha_or_thres=0.1)[1:] == (0.0, True)
    with pytest.raises(rc.SettingError, match="threshold"):
        fixed.run_test_raw(array[0], array[1])
    assert GPDC().measure == "gp_dc" and CMIknn(workers=1).significance == "shuffle_test"


class Mine(ParCorr):
    """A test with a function that the engine would never call."""

    def get_dependence_measure(self, array, xyz):
        return 0.0


class Oracle:
    """a -> b at lag 1 and nothing else; asked on nodes."""

    def __init__(self):
        self.asked = []

    def run_test(self, X, Y, Z=None, tau_max=0):
        self.asked.append((tuple(X), tuple(Y), tuple(Z)))
        return (1.0, 0.0) if (X, Y) == ([(0, -1)], [(1, 0)]) else (0.0, 1.0)


def test_a_test_on_nodes_is_asked_each_question_once():
    oracle = Oracle()
    pcmci = PCMCI(pp.DataFrame(np.zeros((40, 3))), oracle)
    results = pcmci.run_pcmci(tau_max=1, pc_alpha=0.05)
    assert pcmci.graph_to_dict(results["graph"]) == {0: {}, 1: {(0, -1): "-->"}, 2: {}}
    assert pcmci.return_parents_dict(results["graph"], results["val_matrix"])[1] == [(0, -1)]
    assert len(oracle.asked) == len(set(oracle.asked))


class _AllButOnePair:
    """Every pair depends on each other but 0 and 2, whatever is given; remembers what it was asked."""

    def __init__(self):
        self.asked = []

    def run_test(self, X, Y, Z, tau_max):
        self.asked.append((X[0], Y[0], list(Z)))
        apart = {X[0][0], Y[0][0]} == {0, 2} and X[0][1] == 0
        return (0.0, 0.5) if apart else (5.0 + X[0][0], 0.001)


def test_sets_of_every_size_vote_whatever_the_limit_of_the_skeleton(chain):
    found = PCMCI(pp.DataFrame(chain), _AllButOnePair()).run_pcalg_non_timeseries_data(max_conds_dim=0)
    assert (0, 1, 2) in found["ambiguous_triples"], "the empty set and that of the middle separate: a tie"
    assert found["graph"][0, 1, 0] == found["graph"][2, 1, 0] == "o-o"


def test_a_certain_link_has_strength_1_among_the_conditions(chain):
    links = {0: {(1, 0): "o?o", (2, 0): "o?o"}, 1: {(0, 0): "o?o", (2, 0): "-->"}, 2: {(0, 0): "o?o", (1, 0): "<--"}}
    test, links = _AllButOnePair(), {j: {**of, (j, -1): "-?>"} for j, of in links.items()}
    PCMCI(pp.DataFrame(chain), test).run_pcalg(tau_max=1, pc_alpha=0.01, link_assumptions=links)
    first = next(z for x, y, z in test.asked if (x, y) == ((0, 0), (1, 0)) and len(z) == 1)
    assert first == [(1, -1)], "its own past, of strength 6, comes before the certain link"


def test_what_is_known_to_be_absent_has_no_strength_in_lpcmci():
    x = np.random.default_rng(0).normal(size=(200, 3))
    for t in range(1, 200):
        x[t] += 0.5 * x[t - 1]
        x[t, 1] += 0.6 * x[t, 0]
        x[t, 2] += 0.6 * x[t, 1]
    links = {0: {(1, 0): "o?o"}, 1: {(0, 0): "o?o", (2, 0): "o?o"}, 2: {(1, 0): "o?o"}}
    found = LPCMCI(pp.DataFrame(x), ParCorr()).run_lpcmci(link_assumptions={j: {**of, (j, -1): "o?>"} for j, of in links.items()})
    assert found["val_matrix"][0, 2].tolist() == [0, 0] and found["p_matrix"][0, 2].tolist() == [1, 1]


def test_results_are_printed_in_the_references_layout(pcmci, capsys):
    pcmci.print_results(pcmci.run_pcmci(tau_min=1))
    text = capsys.readouterr().out
    assert "## Significant links at alpha = 0.05:" in text
    assert "    Variable b has " in text and "        (a -1): pval = 0.00000 | val =  0." in text


def test_what_is_changed_in_place_counts_at_the_next_run():
    """Two seasons of opposite sign, and the mask flipped between them, as in the reference's tutorial on masks."""
    rng = np.random.default_rng(0)
    x, mask = rng.normal(size=(600, 2)), np.zeros((600, 2), bool)
    mask[300:] = True
    for t in range(1, 600):
        x[t, 1] += (0.9 if t < 300 else -0.9) * x[t - 1, 0]
    frame = pp.DataFrame(x, mask=mask)
    pcmci = PCMCI(frame, ParCorr(mask_type="y"))
    value = lambda: float(pcmci.run_pcmci(tau_max=1)["val_matrix"][0, 1, 1])
    assert value() > 0.6
    frame.mask[0] = ~frame.mask[0]
    assert value() < -0.6
    pcmci.cond_ind_test.mask_type = None
    assert abs(value()) < 0.2
    frame.reference_points = np.arange(2, 300)
    assert value() > 0.6
    frame.reference_points = np.arange(600)
    frame.values[0][:, 1] *= -1
    frame.mask = mask
    pcmci.cond_ind_test.mask_type = "y"
    assert value() < -0.6
    frame.var_names = ["cause", "effect"]
    assert pcmci.var_names == ["cause", "effect"] and pcmci.N == 2


def test_frames_and_tests_travel(chain):
    frame = pp.DataFrame(chain, var_names=list("abc"))
    for way in (copy.copy, copy.deepcopy, lambda each: pickle.loads(pickle.dumps(each))):
        again = PCMCI(way(frame), way(ParCorr())).run_pcmci()
        assert np.array_equal(again["val_matrix"], PCMCI(frame, ParCorr()).run_pcmci()["val_matrix"])


def test_dicts_of_one_dataset_are_the_dataset(chain):
    mask = np.zeros(chain.shape)
    mask[:50] = 1
    frame = pp.DataFrame({0: chain}, mask={0: mask}, datatime={0: np.arange(300)}, data_type=np.zeros(chain.shape, int))
    found = PCMCI(frame, ParCorr(mask_type="y")).run_pcmci()
    alike = PCMCI(pp.DataFrame(chain, mask=mask), ParCorr(mask_type="y")).run_pcmci()
    assert np.array_equal(found["p_matrix"], alike["p_matrix"])
    with pytest.raises(rc.DataError, match="multiple"):
        pp.DataFrame({0: chain, 1: chain})


def test_open_marks_at_lags_are_those_of_the_past(chain):
    run = lambda mark: PCMCI(pp.DataFrame(chain), ParCorr()).run_pcmci(link_assumptions={0: {}, 1: {(0, -1): mark}, 2: {}})
    assert np.array_equal(run("o?o")["p_matrix"], run("-?>")["p_matrix"])
    assert run("o-o")["graph"][0, 1, 1] == "-->"
    with pytest.raises(rc.SettingError, match="link_assumptions"):
        run(">")


def test_values_alone_are_the_values(pcmci):
    for run in (pcmci.run_fullci, pcmci.get_lagged_dependencies):
        found = run(tau_max=2, val_only=True)
        assert list(found) == ["val_matrix", "conf_matrix"]
        assert np.array_equal(found["val_matrix"], run(tau_max=2)["val_matrix"])
    # tigramite 5.2.10.1 does not make them alike from both sides at lag 0.
    values = pcmci.run_bivci(tau_max=2, val_only=True)["val_matrix"]
    assert np.array_equal(values[:, :, 1:], pcmci.run_bivci(tau_max=2)["val_matrix"][:, :, 1:])
    assert values[0, 1, 0] == pcmci.cond_ind_test.get_measure([(0, 0)], [(1, 0)], [(1, -1), (1, -2)], tau_max=2)


def test_an_array_of_a_test_has_three_roles_and_types(chain):
    frame = pp.DataFrame(chain, data_type=np.zeros(chain.shape, int))
    array, xyz, nodes, types = frame.construct_array([(0, -1)], [(1, 0)], [(2, -1)], tau_max=1, return_cleaned_xyz=True)
    assert nodes == ([(0, -1)], [(1, 0)], [(2, -1)]) and xyz.tolist() == [0, 1, 2]
    assert types.shape == array.shape and not types.any()


def test_vectors_are_variables_of_several_columns(chain):
    frame = pp.DataFrame(chain, vector_vars={0: [(0, 0), (2, 0)], 1: [(1, 0)]}, var_names=["pair", "single"])
    found = PCMCI(frame, ParCorrMult()).run_pcmci(tau_max=1)
    assert frame.N == 2 and found["graph"].shape == (2, 2, 2) and found["graph"][0, 1, 1] == "-->"
    assert frame.construct_array([(0, -1)], [(1, 0)], [], tau_max=1)[1].tolist() == [0, 0, 1]
    value = found["val_matrix"][0, 1, 1]
    assert ParCorrMult().run_test_raw(chain[1:-1, [0, 2]], chain[2:, 1], chain[1:-1, 1])[0] == pytest.approx(value, abs=0.05)
    alike = pp.DataFrame(chain, vector_vars={k: [(k, 0)] for k in range(3)})
    assert np.array_equal(PCMCI(alike, ParCorr()).run_pcmci()["p_matrix"], PCMCI(pp.DataFrame(chain), ParCorr()).run_pcmci()["p_matrix"])
    with pytest.raises(ValueError):
        PCMCI(frame, ParCorr()).run_pcmci()


def test_types_that_contradict_the_values_are_refused(chain):
    x = chain.copy()
    x[:, 0] = x[:, 0] > 0
    types = np.zeros(x.shape, int)
    types[:, 0] = 1
    assert PCMCI(pp.DataFrame(x, data_type=types), RegressionCI()).run_pcmci()["p_matrix"].shape == (3, 3, 2)
    with pytest.raises(NotImplementedError, match="data_type"):
        PCMCI(pp.DataFrame(x, data_type=np.zeros(x.shape, int)), RegressionCI()).run_pcmci()


def test_helpers_of_the_data_give_the_references_numbers():
    d = np.array([[3.0, 1], [2, 5], [7, 2], [4, 4], [1, 9]])
    # Numbers of tigramite 5.2.10.1.
    assert pp.trafo2normal(d)[:, 0] == pytest.approx([0.2533471, -0.2533471, 3.0902323, 0.8416212, -0.8416212], abs=1e-7)
    assert pp.time_bin_with_mask(d, 2)[0].tolist() == [[2.5, 3.0], [5.5, 3.0]] and pp.time_bin_with_mask(d, 2)[1] == 2
    mask = np.zeros(d.shape)
    mask[0:2, 0] = 1
    assert pp.time_bin_with_mask(d, 2, mask=mask)[0].tolist() == [[0.0, 3.0], [5.5, 3.0]]
    mean, deviation = pp.weighted_avg_and_std(d, 0, np.array([1, 2, 3, 1, 1.0]).reshape(5, 1) * np.ones((5, 2)))
    assert mean.tolist() == [4.125, 3.75] and deviation.tolist() == pytest.approx([2.368411915187052, 2.436698586202241])


def test_a_toy_model_makes_the_references_series():
    links = {0: [((0, -1), 0.5, lambda x: x), ((1, 0), 0.2, lambda x: x)], 1: [((1, -2), 0.4, lambda x: x)], 2: []}
    data, runs_away = toys.structural_causal_process(links, T=4, seed=3)
    # Numbers of tigramite 5.2.10.1.
    assert data[2:].tolist() == pytest.approx(np.array([[0.27601305, -0.19369677, -1.3138647], [-1.879267, -0.76890427, 0.8846224]]), abs=1e-7)
    assert not runs_away and toys.structural_causal_process({0: [((0, -1), 3.0, lambda x: x)]}, T=1000, seed=1)[1]
    graph = PCMCI.get_graph_from_dict(links)
    assert graph[:, :, 0].tolist() == [["", "-->", ""], ["<--", "", ""], ["", "", ""]][::1] or graph[1, 0, 0] == "-->"
    assert np.array_equal(graph, toys.links_to_graph(links)) and graph.shape == (3, 3, 3)


def test_hidden_causes_contexts_and_oracles_have_the_references_names(chain):
    hidden = LPCMCI(pp.DataFrame(chain), ParCorr()).run_lpcmci(tau_max=2, pc_alpha=0.01)
    assert list(hidden) == ["graph", "p_matrix", "val_matrix"] and hidden["graph"][0, 1, 1] in ("-->", "o->")
    x = np.random.default_rng(3).normal(size=(4, 120, 2)) + 3 * np.arange(4)[:, None, None]
    frame = pp.DataFrame(x, analysis_mode="multiple")
    plain = JPCMCIplus({0: "system", 1: "system"}, dataframe=frame, cond_ind_test=ParCorrMult()).run_jpcmciplus(tau_max=1, pc_alpha=0.01)
    assert plain["graph"][0, 1, 0] != "", "levels of datasets make a link"
    dummies = {k: np.hstack([x[k], np.eye(4)[[k] * 120]]) for k in range(4)}
    vectors = {0: [(0, 0)], 1: [(1, 0)], 2: [(k, 0) for k in range(2, 6)]}
    frame = pp.DataFrame(dummies, analysis_mode="multiple", vector_vars=vectors)
    classes = {0: "system", 1: "system", 2: "space_dummy"}
    joint = JPCMCIplus(classes, dataframe=frame, cond_ind_test=ParCorrMult()).run_jpcmciplus(tau_max=1, pc_alpha=0.01)
    assert joint["graph"].shape == (3, 3, 2) and joint["graph"][0, 1, 0] == "" and joint["graph"][2, 0, 0] == "-->"
    truth = {0: [], 1: [((0, -1), 1.0, None)], 2: [((1, 0), 1.0, None)]}
    found = PCMCI(pp.DataFrame(np.zeros((30, 3))), OracleCI(truth)).run_pcmciplus(tau_max=1, pc_alpha=0.01)
    assert found["graph"][0, 1, 1] == "-->" and found["graph"][1, 2, 0] == "-->"
    some = OracleCI(truth, observed_vars=[0, 2])
    assert some.run_test([(0, -1)], [(1, 0)])[0] == 1.0


def test_resamples_of_a_test_of_ones_own_see_the_draw(chain):
    class Both:
        def run_test(self, X, Y, Z, tau_max):
            raise AssertionError("asked about the data as they are")

        def run_test_raw(self, x, y, z=None):
            return ParCorr().run_test_raw(x, y, z)

    pcmci = PCMCI(pp.DataFrame(chain), Both())
    found = pcmci.run_bootstrap_of("get_lagged_dependencies", {"tau_max": 1}, boot_samples=3, seed=1)
    assert np.ptp(found["boot_results"]["val_matrix"][:, 0, 1, 1]) > 0
