"""Resamples and windows: `rc.discover(resamples=..)`, `rc.roll`, `run_bootstrap_of`, `run_sliding_window_of`."""

import csv
import json

import numpy as np
import pytest
from conftest import ROOT

import roscausal as rc
from roscausal.tigramite import data_processing as pp
from roscausal.tigramite.independence_tests.parcorr import ParCorr
from roscausal.tigramite.pcmci import PCMCI

GOLDEN = ROOT / "tests" / "golden" / "confidence"
BOOT = sorted(path.stem for path in GOLDEN.glob("boot_*.json"))


def table(system):
    with open(GOLDEN / f"{system}.csv", newline="") as file:
        header, *rows = csv.reader(file)
    return header, np.array([[float(cell) if cell not in ("", "nan") else np.nan for cell in row] for row in rows])


def case_of(name):
    case = json.loads((GOLDEN / f"{name}.json").read_text())
    names, values = table(case["system"])
    settings = {"tau_min": case["tau_min"], "tau_max": case["tau_max"], "pc_alpha": case["pc_alpha"]}
    return case, names, values, settings


def test_there_are_reference_cases():
    assert len(BOOT) == 4


@pytest.mark.parametrize("name", BOOT)
def test_a_bootstrap_gives_the_references_counts_and_summary(name):
    case, names, values, settings = case_of(name)
    if case["method"] == "pcmci":
        settings["alpha_level"] = case["alpha"]
    pcmci = PCMCI(pp.DataFrame(values, var_names=names), ParCorr())
    found = pcmci.run_bootstrap_of(
        f"run_{case['method']}", settings, boot_samples=case["resamples"], boot_blocklength=case["block"], seed=case["seed"]
    )
    graphs = found["boot_results"]["graph"]
    for mark, counts in case["mark_counts"].items():
        if mark:
            assert np.abs((graphs == mark).sum(axis=0) - np.array(counts)).max() <= 1, mark
    summary = found["summary_results"]
    # One resample whose p-value lies at the level may differ.
    assert np.abs(summary["link_frequency"] - np.array(case["link_frequency"])).max() <= 1.001 / case["resamples"]
    assert (summary["most_frequent_links"] == np.array(case["most_frequent_links"])).mean() > 0.97
    assert summary["val_matrix_mean"] == pytest.approx(np.array(case["val_matrix_mean"]), abs=1e-6)
    assert summary["val_matrix_interval"] == pytest.approx(np.array(case["val_matrix_interval"]), abs=1e-6)


@pytest.mark.parametrize("name", [name for name in BOOT if "contemp" not in name])
def test_both_apis_draw_the_same_resamples(name):
    case, names, values, settings = case_of(name)
    model = rc.discover(
        values, columns=names, method=case["method"], test=case["test"], alpha=case["alpha"], **settings,
        resamples=case["resamples"], resampling="bootstrap", block=case["block"], seed=case["seed"],
    )  # fmt: skip
    pcmci = PCMCI(pp.DataFrame(values, var_names=names), ParCorr())
    found = pcmci.run_bootstrap_of("run_pcmci", settings, case["resamples"], case["block"], seed=case["seed"])
    share = (found["boot_results"]["graph"] != "").mean(axis=0)
    assert model.link_frequency == pytest.approx(share, abs=1e-12)
    assert model.val_low == pytest.approx(found["summary_results"]["val_matrix_interval"][..., 0], abs=1e-9)


def test_windows_give_the_references_numbers_and_those_of_roll():
    case, names, values, settings = case_of("window_lin3_parcorr")
    pcmci = PCMCI(pp.DataFrame(values, var_names=names), ParCorr())
    found = pcmci.run_sliding_window_of("run_pcmci", settings, window_step=case["step"], window_length=case["window"])
    ours = found["window_results"]
    assert ours["val_matrix"][..., 1:] == pytest.approx(np.array(case["val_matrix"]), abs=1e-8)
    assert ours["p_matrix"][..., 1:] == pytest.approx(np.array(case["p_matrix"]), abs=1e-8)
    assert found["summary_results"]["link_frequency"] == pytest.approx(np.array(case["link_frequency"]), abs=1e-9)
    rolling = rc.roll(
        values, columns=names, window=case["window"], step=case["step"], method="pcmci", test="parcorr", **settings
    )  # fmt: skip
    assert [each.start for each in rolling][: len(case["starts"])] == case["starts"]
    for window, matrix in zip(rolling, ours["val_matrix"]):
        assert window.model.val_matrix[..., 1:] == pytest.approx(matrix[..., 1:], abs=1e-10)


def test_a_time_budget_ends_the_windows_and_says_after_how_many(chain, quick):
    none = rc.roll(chain, window=100, **quick, time_budget=1e-9)
    assert len(none) == 0 and none.status == "partial: the time budget ended after 0 of 3 windows"
    assert none.marks("x0", "x1", 1) == []
    every = rc.roll(chain, window=100, **quick, time_budget=3600)
    assert len(every) == 3 and every.status == "complete"


def test_resamples_say_how_often_a_link_is_found(chain, quick):
    model = rc.discover(chain, columns=list("abc"), **quick, resamples=40)
    shares = {(link.cause, link.effect, link.lag): link.confidence for link in model.links}
    assert shares["a", "b", 1] == 1.0 and all(0 <= share <= 1 for share in shares.values())
    assert model.link_frequency.shape == model.val_low.shape == model.val_high.shape == (3, 3, 3)
    assert np.all(model.val_low <= model.val_high) and model.settings["resampling"]["done"] == 40
    assert all(isinstance(advice, rc.Advice) and advice.sentence for advice in model.advice)
    assert rc.Model(model.to_json()) == model and "found again" in model._repr_html_()
    assert model == rc.discover(chain, columns=list("abc"), **quick, resamples=40, threads=1)
    plain = rc.discover(chain, columns=list("abc"), **quick)
    assert plain.link_frequency is None and plain.advice == [] and plain.links[0].confidence is None
    assert np.array_equal(plain.p_matrix, model.p_matrix, equal_nan=True)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"resamples": 5}, "resamples"),
        ({"resamples": 40, "resampling": "jackknife"}, "subsample"),
        ({"resamples": 40, "share": 1.5}, "share"),
        ({"resamples": 40, "block": 0}, "block"),
        ({"resamples": 40, "block": "long"}, "cube_root"),
        ({"resamples": 40, "test": lambda x, y, z: (0.0, 1.0)}, "run_bootstrap_of"),
    ],
)
def test_resamples_that_say_nothing_are_refused(chain, quick, settings, message):
    with pytest.raises(rc.SettingError, match=message):
        rc.discover(chain, **{**quick, **settings})


def test_a_bootstrap_takes_a_test_of_ones_own_and_leaves_the_data_as_they_were(chain):
    asked = []

    def correlation(x, y, z):
        asked.append(len(x))
        r = np.corrcoef(x, y)[0, 1]
        return r, float(abs(r) < 0.2)

    pcmci = PCMCI(pp.DataFrame(chain), correlation)
    before = pcmci.run_bivci(tau_max=1)["val_matrix"]
    found = pcmci.run_bootstrap_of("run_bivci", {"tau_max": 1}, boot_samples=3, seed=1)
    assert found["boot_results"]["graph"].shape == (3, 3, 3, 2) and set(asked) == {298}
    assert not np.array_equal(found["boot_results"]["val_matrix"][0], found["boot_results"]["val_matrix"][1])
    assert np.array_equal(pcmci.run_bivci(tau_max=1)["val_matrix"], before)
    again = pcmci.run_bootstrap_of("run_bivci", {"tau_max": 1}, boot_samples=3, seed=1)
    assert np.array_equal(found["boot_results"]["val_matrix"], again["boot_results"]["val_matrix"])
    with pytest.raises(rc.SettingError, match="run_mci"):
        pcmci.run_bootstrap_of("run_pc_stable", {})
    with pytest.raises(rc.SettingError, match="boot_samples"):
        pcmci.run_bootstrap_of("run_bivci", {}, boot_samples=0)
    with pytest.raises(NotImplementedError, match="from_autocorrelation"):
        pcmci.run_bootstrap_of("run_bivci", {}, boot_blocklength="from_autocorrelation")


def test_windows_follow_a_link_that_ends(quick):
    x = np.random.default_rng(4).normal(size=(600, 2))
    x[1:300, 1] += x[:299, 0]
    told = []
    rolling = rc.roll(x, columns=["a", "b"], window=150, alpha=0.001, progress=lambda *numbers: told.append(numbers), **quick)
    assert rolling.marks("a", "b", 1) == ["-->", "-->", "", ""] and told[-1] == (4, 4)
    assert rolling.values("a", "b", 1)[0] > 0.5 > rolling.values("a", "b", 1)[3]
    assert len(rolling) == 4 and rolling[1].model.series().svg.startswith("<svg")
    two = rc.roll([x[:300], x[300:]], columns=["a", "b"], window=150, **quick)
    assert [(each.recording, each.start) for each in two] == [(0, 0), (0, 150), (1, 0), (1, 150)]
    for settings, message in [({"window": 700}, "leave no window"), ({"window": 0}, "window"), ({"window": 9, "step": 0}, "step")]:
        with pytest.raises(rc.SettingError, match=message):
            rc.roll(x, **{**quick, **settings})
    with pytest.raises(rc.SettingError, match="resamples"):
        rc.roll(x, window=150, resamples=20)
    with pytest.raises(rc.SettingError, match="weather"):
        rolling.marks("weather", "b", 1)
