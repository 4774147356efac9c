"""The classes of `roscausal.tigramite`: return values, refusals, windows, several datasets, tests of one's own."""

import numpy as np
import pytest

import roscausal as rc
from roscausal.tigramite import data_processing as pp
from roscausal.tigramite.independence_tests.cmiknn import CMIknn
from roscausal.tigramite.independence_tests.gpdc import GPDC
from roscausal.tigramite.independence_tests.parcorr import ParCorr
from roscausal.tigramite.pcmci import PCMCI


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
        (lambda: pcmci.run_mci(val_only=True), "val_only"),
        (lambda: pp.DataFrame(chain, vector_vars={0: [(0, 0)]}), "vector_vars"),
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


def test_results_are_printed_in_the_references_layout(pcmci, capsys):
    pcmci.print_results(pcmci.run_pcmci(tau_min=1))
    text = capsys.readouterr().out
    assert "## Significant links at alpha = 0.05:" in text
    assert "    Variable b has " in text and "        (a -1): pval = 0.00000 | val =  0." in text
