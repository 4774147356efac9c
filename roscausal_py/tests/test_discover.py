"""`rc.discover`: what it takes, what it gives, and what the command gives."""

import copy
import inspect
import json
import multiprocessing
import os
import pathlib
import pickle
import signal
import subprocess
import sys
import threading
import typing

import numpy as np
import pytest
from conftest import ROOT

import roscausal as rc
from roscausal import _native
from roscausal.settings import Method, Settings

COMMAND = pathlib.Path(sys.executable).parent / "roscausal"


def drives(model):
    return {(link.cause, link.effect) for link in model.links if link.cause != link.effect}


def written(folder, x, names="abc"):
    path = folder / "data.csv"
    np.savetxt(path, x, fmt="%.17g", delimiter=",", header=",".join(names), comments="")
    return path


@pytest.mark.parametrize("method", ["fpcmci", "pcmci", "pcmciplus", "fullci", "bivci", "lagdep"])
def test_a_model_has_the_bytes_of_the_commands(chain, tmp_path, method):
    path = written(tmp_path, chain)
    subprocess.run(
        [COMMAND, "discover", path, "--method", method, "--test", "parcorr", "--tau-max", "2", "--out", tmp_path / "out"],
        check=True, capture_output=True,
    )  # fmt: skip
    model = rc.discover(chain, columns=list("abc"), method=method, test="parcorr", tau_max=2)
    assert model.to_json() == (tmp_path / "out" / "model.json").read_text()
    assert rc.discover(path, method=method, test="parcorr", tau_max=2) == model


def test_several_files_are_recordings_of_one_system(chain, tmp_path, quick):
    (tmp_path / "1").mkdir()
    files = [written(tmp_path, chain[:150]), written(tmp_path / "1", chain[150:])]
    model = rc.discover(files, **quick)
    assert model == rc.discover([chain[:150], chain[150:]], columns=list("abc"), **quick)
    assert model.settings["n_recordings"] == 2
    assert model != rc.discover(chain, columns=list("abc"), **quick)


STUDIES = sorted((ROOT / "tests/studies").glob("*.json"))


@pytest.mark.parametrize("path", STUDIES, ids=lambda path: path.stem)
def test_python_has_the_facts_of_each_study(path, monkeypatch):
    # In their folder: a note names a file as it was given.
    monkeypatch.chdir(ROOT / "docs/studies")
    model = rc.discover([file.name for file in sorted(pathlib.Path().glob(f"{path.stem}*.csv"))])
    # As data; a text names a setting as its surface does.
    facts = lambda summary: json.dumps(summary).replace("--", "").replace("-", "_")
    assert facts(model.summary) == facts(json.loads(path.read_text())["summary"])
    assert len(STUDIES) == 12


def test_every_layout_of_an_array_gives_the_same_model(chain, quick):
    model = rc.discover(chain, **quick)
    readonly = chain.copy()
    readonly.flags.writeable = False
    doubled = np.repeat(chain, 2, axis=0)[::2]
    for array in (np.asfortranarray(chain), chain.astype(">f8"), readonly, doubled, np.ma.array(chain)):
        assert rc.discover(array, **quick) == model
    single = rc.discover(chain.astype(np.float32), **quick)
    assert np.allclose(single.val_matrix, model.val_matrix, atol=1e-6, equal_nan=True)
    whole = (chain * 100).astype(np.int32)
    assert drives(rc.discover(whole, **quick)) == drives(model)


def test_masked_values_are_missing_values(chain, quick):
    holes = np.zeros(chain.shape, dtype=bool)
    holes[20:30, 1] = True
    masked = rc.discover(np.ma.array(chain, mask=holes), **quick)
    assert masked == rc.discover(np.where(holes, np.nan, chain), **quick)
    assert any(link.n_lost > 0 for link in masked.links)


def test_tables_and_dicts_give_the_model_of_their_array(chain, quick):
    model = rc.discover(chain, columns=list("abc"), **quick)
    assert rc.discover({name: chain[:, k] for k, name in enumerate("abc")}, **quick) == model
    assert rc.discover(chain, columns=list("abc"), **quick).to_json() == model.to_json()
    picked = rc.discover({name: chain[:, k] for k, name in enumerate("abc")}, columns=["c", "a"], **quick)
    assert picked.features == ["c", "a"]




def test_time_gives_the_step_and_is_no_variable(chain, quick):
    times = np.arange(300) * 0.25
    model = rc.discover({"time": times, "a": chain[:, 0], "b": chain[:, 1]}, **quick)
    assert model.dt == 0.25 and model.features == ["a", "b"]
    with pytest.raises(rc.DataError, match="row 4, column 'time': time goes back"):
        rc.discover({"time": np.where(np.arange(300) == 3, 0, times), "a": chain[:, 0], "b": chain[:, 1]}, **quick)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (np.zeros(30), "(T, N)"),
        (np.zeros((3, 4, 5)), "(T, N)"),
        (np.array([["a", "b"]]), "not numbers"),
        (np.zeros((30, 2), complex), "not numbers"),
        (np.zeros((0, 2)), "samples"),
        (np.zeros((30, 1)), "only one variable"),
        (np.full((30, 2), np.inf), "inf"),
        ([], "empty"),
        ([1.0, 2.0], "one variable"),
        ({"a": [1.0, 2.0], "b": [1.0]}, "different lengths"),
        ({"a": np.zeros(30), "b": ["x"] * 30}, "'b'"),
        ([np.zeros((30, 2)), np.zeros((30, 3))], "recording 1"),
        ("nowhere.csv", "nowhere.csv"),
        (object(), "not understood"),
    ],
)
def test_data_that_cannot_be_analysed_are_refused_in_a_sentence(data, message):
    with pytest.raises(rc.DataError, match=message.replace("(", r"\(").replace(")", r"\)")):
        rc.discover(data, method="pcmci", test="parcorr")


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"alpha": 0}, "alpha"),
        ({"method": "pcmc"}, "did you mean 'pcmci'"),
        ({"test": "parcor"}, "did you mean 'parcorr'"),
        ({"tau_min": 3}, "tau_max"),
        ({"tau_max": 0}, "tau_max"),
        ({"tau_max": 1.5}, "tau_max"),
        ({"tau_max": 400}, "tau_max"),
        ({"tau_max": 10**9}, "tau_max.*above 100000"),
        ({"tau_max": 10**19}, "tau_max.*above 100000"),
        ({"fdr": "bonferroni"}, "fdr_bh"),
        ({"pc_alpha": "score"}, "pc_alpha"),
        ({"time_budget": -1.0}, "time_budget"),
        ({"exogenous": ["weather"]}, "weather"),
        ({"te_estimator": "gaussian"}, "te_estimator.*it applies to fpcmci"),
        ({"f_alpha": 0.1}, "f_alpha.*it applies to fpcmci"),
        ({"acts_on": {"a": "b"}}, "acts_on.*it applies to candoit"),
        ({"gp_restarts": 2}, "gp_restarts.*it applies to the test gpdc"),
        ({"dt": 0}, "'dt': 0 is not a number of seconds above 0"),
        ({"dt": -0.5}, "'dt': -0.5 is not"),
        ({"columns": ["x"]}, "columns"),
        ({"test": 3}, "test"),
        ({"alpha": object()}, "neither a number"),
    ],
)
def test_settings_that_are_not_allowed_are_refused_with_pythons_names(chain, settings, message):
    with pytest.raises(ValueError, match=message) as caught:
        rc.discover(chain, **{"method": "pcmci", "test": "parcorr", **settings})
    assert "--" not in str(caught.value) and isinstance(caught.value, (rc.SettingError, rc.DataError))


def test_windows_and_recordings_with_a_step_of_no_seconds_are_refused(chain, quick):
    with pytest.raises(rc.SettingError, match="'dt': 0 is not"):
        rc.roll(chain, window=50, dt=0, **quick)
    with pytest.raises(rc.SettingError, match="'dt': 0 is not"):
        rc.discover(rc.Recordings(["a", "b"], [np.zeros((60, 2))], dt=0), **quick)


def test_numpys_numbers_are_settings_like_any(chain):
    model = rc.discover(chain, method="pcmci", test="parcorr", tau_max=np.int64(2), alpha=np.float32(0.05), seed=np.uint8(3))
    assert model.settings["tau_max"] == 2


def test_threads_do_not_change_the_result(chain):
    one = rc.discover(chain, test="gpdc", threads=1)
    assert one == rc.discover(chain, test="gpdc", threads=3)


def test_models_come_from_many_threads_and_forks(chain, quick):
    model, found = rc.discover(chain, **quick), []
    threads = [threading.Thread(target=lambda: found.append(rc.discover(chain, **quick))) for _ in range(8)]
    [thread.start() for thread in threads]
    [thread.join() for thread in threads]
    assert found == [model] * 8
    if hasattr(os, "fork"):
        with multiprocessing.get_context("fork").Pool(2) as pool:
            assert pool.starmap(forked, [(chain, quick)] * 4) == [model] * 4


def forked(data, settings):
    return rc.discover(data, **settings)


def test_progress_reaches_its_total_and_an_exception_of_it_ends_the_run(chain, capsys):
    calls = []
    rc.discover(chain, method="pcmci", progress=lambda done, total: calls.append((done, total)))
    assert calls[-1][0] == calls[-1][1] > 0
    rc.discover(chain, method="pcmci", progress=True)
    line = capsys.readouterr().err.split("\r")[-1]
    done, total = line.split("#")[-1].split(" tests")[0].split("/")
    assert line.startswith("#" * 30) and int(done) == int(total) > 0 and line.endswith("\n")

    def refuse(done, total):
        raise RuntimeError("enough")

    with pytest.raises(RuntimeError, match="enough"):
        rc.discover(chain, method="pcmci", progress=refuse)


def test_a_time_budget_gives_a_partial_model():
    x = np.random.default_rng(1).normal(size=(400, 6))
    model = rc.discover(x, method="pcmci", test="cmiknn", time_budget=0.2)
    assert model.status.startswith("partial")
    assert "partial" in model._repr_html_() and "partial" in str(model)


def test_ctrl_c_ends_an_analysis():
    code = (
        # Whoever starts the tests in the background of a shell has the signal ignored.
        "import signal\nsignal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "import numpy as np, roscausal as rc\nx = np.random.default_rng(1).normal(size=(800, 8))\n"
        "told = lambda done, total: print('running', flush=True)\n"
        "try:\n    rc.discover(x, method='pcmci', test='cmiknn', progress=told)\n"
        "except KeyboardInterrupt:\n    print('interrupted')\n"
    )
    run = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
    assert run.stdout.readline() == "running\n"
    run.send_signal(signal.SIGINT)
    assert run.communicate(timeout=300)[0].endswith("interrupted\n") and run.returncode == 0


def correlation(x, y, z):
    """A test of one's own: correlation of residuals."""
    ones = np.column_stack([np.ones(len(x)), z])
    rx, ry = (v - ones @ np.linalg.lstsq(ones, v, rcond=None)[0] for v in (x, y))
    r = rx @ ry / np.sqrt((rx @ rx) * (ry @ ry))
    return r, min(1.0, 2 * np.exp(-0.5 * len(x) * r * r))


class Raw:
    """The same as an object."""

    def __init__(self):
        self.shapes = set()

    def run_test_raw(self, x, y, z=None):
        self.shapes.add((x.shape[1], y.shape[1]))
        return correlation(x[:, 0], y[:, 0], np.empty((len(x), 0)) if z is None else z)


class Oracle:
    """Knows that only 0 -> 1 at lag 1 exists."""

    def run_test(self, X, Y, Z, tau_max):
        known = X == [(0, -1)] and Y == [(1, 0)]
        return (1.0, 0.0) if known else (0.0, 1.0)


def test_a_users_own_test_decides(chain):
    raw = Raw()
    for test in (correlation, raw):
        model = rc.discover(chain, method="pcmci", test=test)
        assert {("x0", "x1"), ("x1", "x2")} <= drives(model)
        assert model.settings["cond_ind_test"] == "custom"
    assert raw.shapes == {(1, 1)}
    assert drives(rc.discover(chain, method="pcmci", test=Oracle())) == {("x0", "x1")}


def test_faults_of_a_users_own_test_come_out_as_they_are(chain):
    def broken(x, y, z):
        raise ZeroDivisionError("mine")

    with pytest.raises(ZeroDivisionError, match="mine"):
        rc.discover(chain, method="pcmci", test=broken)
    for answer in ((float("nan"), 0.5), (0.5, 1.5), (0.5, float("nan"))):
        with pytest.raises(rc.DataError, match=r"X = \("):
            rc.discover(chain, method="pcmci", test=lambda x, y, z, answer=answer: answer)
    with pytest.raises(TypeError):
        rc.discover(chain, method="pcmci", test=lambda x, y, z: None)


def test_a_model_stays_itself_through_files_and_pickles(chain, quick, tmp_path):
    model = rc.discover(chain, **quick)
    model.save(tmp_path / "model.json")
    assert rc.load(tmp_path / "model.json") == model == pickle.loads(pickle.dumps(model))
    assert len({model, rc.Model(model.to_json())}) == 1 and model != "model"
    assert model.to_dict()["features"] == model.features
    with pytest.raises(rc.DataError, match="model"):
        rc.Model(json.dumps({"schema": "other"}))
    with pytest.raises(ValueError):
        model.val_matrix[0, 0, 0] = 1.0


def test_a_model_shows_itself(chain, quick, tmp_path):
    model = rc.discover({"<b>": chain[:, 0], "b": chain[:, 1]}, **quick)
    html = model._repr_html_()
    assert "<svg" in html and "&lt;b&gt;" in html and "<script" not in html and "<b></td>" not in html
    assert "drives b" in str(model) and "2 variables" in repr(model)
    for picture in (model.dag(), model.tsdag(), model.series()):
        assert picture._repr_svg_().startswith("<svg")
    model.dag().save(tmp_path / "dag.png")
    model.series().save(tmp_path / "series.svg")
    assert (tmp_path / "dag.png").read_bytes()[:4] == b"\x89PNG"
    model.dag().save(tmp_path / "dag.pdf")
    assert (tmp_path / "dag.pdf").read_bytes()[:5] == b"%PDF-"
    with pytest.raises(rc.SettingError, match=".gif"):
        model.dag().save("dag.gif")
    with pytest.raises(rc.DataError, match="data of this model"):
        rc.Model(model.to_json()).series()
    assert "digraph" in model.to_dot() and "<graphml" in model.to_graphml()
    assert model.to_csv().startswith("cause,effect,lag")


def test_a_p_value_is_never_shown_as_0(chain):
    model = rc.discover(chain, method="pcmci", test="gpdc")
    link = next(link for link in model.links if link.p_value < 0.001)
    assert link.p == "<0.001" and "p < 0.001" in str(link)
    assert "&lt;0.001" in model._repr_html_() and ">0.0<" not in model._repr_html_()


class Message:
    """A ROS message: its fields."""

    def __init__(self, **fields):
        self.__dict__.update(fields)


def test_a_ros_message_becomes_the_model_that_it_came_from(chain, quick):
    model = rc.discover(chain, columns=list("abc"), **quick)
    fields = model.to_dict()
    flat = {name: Message(data=np.ravel(fields[key])) for name, key in
            [("causal_structure", "causal_structure"), ("val_matrix", "val"), ("pval_matrix", "pval")]}  # fmt: skip
    message = Message(features=model.features, original_shape=np.shape(fields["val"]), **flat)
    back = rc.Model.from_msg(message)
    assert [(link.cause, link.effect, link.lag, link.value) for link in back.links] == [
        (link.cause, link.effect, link.lag, link.value) for link in model.links
    ]
    assert np.array_equal(back.graph, model.graph)
    assert back.warnings and rc.Model.from_msg(message, INFO).settings["method"] == "pcmci"
    assert back.outcomes[0, 1, 0] == "not_asked" and set(back.outcomes[:, :, 1].ravel()) <= {"tested", "unknown"}
    with pytest.raises(rc.DataError, match="CausalModel"):
        rc.Model.from_msg(Message())


INFO = Message(
    method="pcmci", cond_ind_test="parcorr", alpha=0.05, pc_alpha=0.2, fdr_method="none", min_lag=1, max_lag=2, dt=0.1,
    n_samples=296, seed=42, candidate_features=["a", "b", "c"],
)  # fmt: skip


def test_a_messages_links_keep_their_marks_and_whether_they_were_tested():
    def link(cause, effect, lag, mark, tested=True):
        number = 0.4 if tested else float("nan")
        return Message(cause=cause, effect=effect, lag=lag, mark=mark, tested=tested, value=number, p_value=number / 100, samples=99)

    links = [link("a", "a", 1, "o->"), link("a", "b", 0, "<->"), link("b", "b", 1, "-->", tested=False)]
    info = Message(**{**INFO.__dict__, "min_lag": 0, "max_lag": 1, "links": links})
    model = rc.Model.from_msg(message_of(there=[0] * 8), info)
    assert [(each.mark, each.value, each.n_used, each.required) for each in model.links] == [
        ("o->", 0.4, 99, False), ("<->", 0.4, 99, False), ("-->", None, None, True)
    ]  # fmt: skip
    assert (str(model.graph[1, 0, 0]), str(model.outcomes[1, 1, 1])) == ("<->", "required")
    assert "required, not tested" in str(model.links[2]) and "not tested" in str(model)
    # In the words of the terminal.
    assert str(model.links[0]).startswith("a at t-1 drives itself, or something not recorded drives it at both times: ")
    assert str(model.links[1]).startswith("a at the same time and b: something not recorded drives both: ")


def test_the_command_comes_with_the_package(tmp_path):
    run = subprocess.run([COMMAND, "--version"], capture_output=True, text=True, check=True)
    assert run.stdout == f"roscausal {rc.__version__}\n"
    run = subprocess.run([COMMAND, "discover", tmp_path / "none.csv"], capture_output=True, text=True)
    assert run.returncode == 1 and "none.csv" in run.stderr


def message_of(there=(0, 0, 1, 0, 1, 0, 0, 0), shape=(2, 2, 2), names=("a", "b"), p=0.01):
    """A message of two variables: a drives b within a moment, and itself a step later."""
    data = Message(data=list(there)), Message(data=[0.5] * len(there)), Message(data=[p] * len(there))
    arrays = dict(zip(("causal_structure", "val_matrix", "pval_matrix"), data))
    return Message(features=list(names), original_shape=list(shape), **arrays)


def test_a_link_within_a_moment_is_known_from_both_ends():
    info = Message(**{**INFO.__dict__, "min_lag": 0, "max_lag": 1, "dt": 0.0})
    model = rc.Model.from_msg(message_of(), info)
    assert [(link.cause, link.effect, link.lag, link.mark) for link in model.links] == [("a", "a", 1, "-->"), ("a", "b", 0, "-->")]
    assert (str(model.graph[0, 1, 0]), str(model.graph[1, 0, 0])) == ("-->", "<--")


@pytest.mark.parametrize(
    ("message", "lags", "told"),
    [
        (message_of(), (4_000_000_000, 4_000_000_001), "too large"),
        (message_of(), (0, 5), "size"),
        (message_of(there=[1] * 8), (0, 1), "itself at lag 0"),
        (message_of(names=["a"]), (0, 1), "features"),
        (message_of(names=["a", "a"]), (0, 1), "there twice"),
        (message_of(names=["a", ""]), (0, 1), "no name"),
        (message_of(p=-1.0), (0, 1), "0 to 1"),
        (message_of(p=float("nan")), (0, 1), "not a valid model"),
        (message_of(there=[0, 0, 7, 0, 1, 0, 0, 0]), (0, 1), "causal_structure holds 7"),
    ],
)
def test_a_ros_message_that_is_no_model_is_refused_in_a_sentence(message, lags, told):
    info = Message(**{**INFO.__dict__, "min_lag": lags[0], "max_lag": lags[1]})
    with pytest.raises(rc.DataError, match=told):
        rc.Model.from_msg(message, info)


def test_the_demo_is_the_commands(tmp_path):
    subprocess.run([COMMAND, "demo", "--out", "command"], cwd=tmp_path, check=True, capture_output=True)
    model = rc.demo(out=tmp_path / "python")
    assert model.features == ["h_v", "h_dg", "h_risk"]
    assert model == rc.load(tmp_path / "command" / "model.json") == rc.load(tmp_path / "python" / "model.json")


@pytest.mark.parametrize("file", ["people.bag", "people.mcap"])
def test_options_of_recordings_are_refused_for_what_is_none(tmp_path, file):
    (tmp_path / file).write_bytes(b"no recording")
    with pytest.raises(rc.DataError, match=file):
        rc.read(tmp_path / file, person=7)
    with pytest.raises(rc.SettingError, match="persn"):
        rc.read(tmp_path / file, persn=7)


def test_a_recording_is_read_as_the_command_reads_it(tmp_path):
    subprocess.run(
        [COMMAND, "demo", "--duration", "60", "--record", "run.mcap", "--out", "demo"],
        cwd=tmp_path, capture_output=True, check=True,
    )  # fmt: skip
    subprocess.run(
        [COMMAND, "discover", tmp_path / "run.mcap", "--test", "parcorr", "--method", "pcmci", "--dt", "0.3", "--out", "out"],
        cwd=tmp_path, capture_output=True, check=True,
    )  # fmt: skip
    walk = rc.read(tmp_path / "run.mcap", dt=0.3)
    model = rc.discover(walk, method="pcmci", test="parcorr")
    assert model.dt == pytest.approx(0.3)
    by_command = rc.load(tmp_path / "out" / "model.json")
    assert model.links == by_command.links
    assert np.array_equal(model.p_matrix, by_command.p_matrix, equal_nan=True)
    # Each says in its own words which setting a note means.
    assert [note.replace("--tau-max", "tau_max") for note in by_command.warnings] == model.warnings


def test_rows_that_where_leaves_out_are_no_effects_in_python_and_in_windows_too(tmp_path):
    x = np.random.default_rng(5).normal(size=(400, 2))
    pause = np.arange(400) % 2
    x[1:, 1] += 2 * x[:-1, 0] * pause[1:]
    table = np.column_stack([x, pause])
    np.savetxt(tmp_path / "data.csv", table, fmt="%.9f", delimiter=",", header="a,b,pause", comments="")
    every = rc.read(tmp_path / "data.csv", columns=["a", "b"])
    some = rc.read(tmp_path / "data.csv", columns=["a", "b"], where="pause < 0.5")
    assert every.masked == [] and some.masked[0].sum() == 200 and some.rows(0, 0, 10).masked[0].sum() == 5
    quick = {"method": "pcmci", "test": "parcorr", "alpha": 0.001}
    marks = [rc.discover(data, **quick).graph[0, 1, 1] for data in (every, some, [some.rows(0, 0, 200), some.rows(0, 200, 400)])]
    assert marks == ["-->", "", ""]
    assert rc.roll(every, window=200, **quick).marks("a", "b", 1) == ["-->", "-->"]
    assert rc.roll(some, window=200, **quick).marks("a", "b", 1) == ["", ""]


def test_the_types_name_every_method_and_the_messages_are_there():
    words = json.loads(_native.words())
    assert sorted(typing.get_args(Method)) == sorted(words["methods"])
    settings = {one["id"] for one in words["settings"]}
    assert {*Settings.__annotations__, "test"} == settings
    assert settings <= set(inspect.signature(rc.discover).parameters)
    assert all(f"{name}: " in inspect.getdoc(rc.discover) for name in settings)
    assert "string[] features" in rc.msg_definitions()["roscausal_msgs/msg/CausalModel"]


def test_people_who_differ_are_pooled_and_an_intervention_is_named():
    rng = np.random.default_rng(3)
    people = [rng.normal(size=(200, 2)) + 2 * k for k in range(2)]
    model = rc.discover(people, columns=["speed", "distance"], method="jpcmciplus")
    assert model.features == ["speed", "distance"] and not drives(model)
    assert model.settings["cond_ind_test"] == "parcorr"
    assert any("the recordings differ in" in warning for warning in model.warnings)
    rng = np.random.default_rng(4)
    x = rng.normal(size=(300, 3))
    x[:, 2] = np.where(np.arange(300) % 4 == 0, 2.0, 0.0)
    x[:, 0] += x[:, 2]
    x[1:, 1] += 0.9 * x[:-1, 0]
    names = ["speed", "gap", "push"]
    model = rc.discover(x, columns=names, method="candoit", test="parcorr", acts_on={"push": "speed"})
    assert drives(model) == {("speed", "gap"), ("push", "speed")}
    with pytest.raises(rc.SettingError, match="no column 'pull'"):
        rc.discover(x, columns=names, method="candoit", test="parcorr", acts_on={"pull": "speed"})


def test_columns_that_belong_together_are_one_variable():
    x = np.random.default_rng(4).normal(size=(300, 3))
    x[1:, 2] += 0.9 * x[:-1, 1]
    usual = {"columns": ["x", "y", "speed"], "method": "pcmci", "test": "parcorrmult"}
    model = rc.discover(x, vectors={"place": ["x", "y"]}, **usual)
    assert model.features == ["place", "speed"]
    assert drives(model) == {("place", "speed")}
    with pytest.raises(rc.SettingError, match="no column 'z'"):
        rc.discover(x, vectors={"place": ["x", "z"]}, **usual)
    with pytest.raises(rc.SettingError, match="takes each variable for one column"):
        rc.discover(x, vectors={"place": ["x", "y"]}, **(usual | {"test": "parcorr"}))


def test_gpdc_takes_null_distributions_from_a_dict_or_a_file(tmp_path):
    x = np.random.default_rng(4).normal(size=(150, 2))
    x[1:, 1] += 2.0 * x[:-1, 0]
    usual = {"columns": ["a", "b"], "method": "pcmci"}
    assert drives(rc.discover(x, **usual)) == {("a", "b")}
    # All values are above what a distance correlation can be, so nothing is a link.
    assert drives(rc.discover(x, null_dist={148: [2.0, 3.0]}, **usual)) == set()
    (tmp_path / "null.csv").write_text("148\n2\n3\n")
    assert drives(rc.discover(x, null_dist=tmp_path / "null.csv", **usual)) == set()
    with pytest.raises(rc.SettingError, match="applies to the test gpdc"):
        rc.discover(x, null_dist={148: [2.0]}, test="parcorr", **usual)


def test_candoit_with_and_without_its_rule_and_limits_that_other_methods_do_not_have():
    rng = np.random.default_rng(3)
    x = rng.normal(size=(300, 3))
    x[:, 2] = np.where(np.arange(300) % 4 == 0, 2.0, 0.0)
    x[:, 0] += x[:, 2]
    x[1:, 1] += 0.9 * x[:-1, 0]
    usual = {"columns": ["speed", "gap", "push"], "method": "candoit", "test": "parcorr", "acts_on": {"push": "speed"}}
    with_rule, without = (rc.discover(x, extra_conditions=rule, **usual) for rule in (True, False))
    assert ("speed", "gap") in drives(without)
    assert not np.array_equal(with_rule.p_matrix, without.p_matrix, equal_nan=True)
    assert ("speed", "gap") in drives(rc.discover(x, max_sets=1, max_conds=2, **usual))
    with pytest.raises(rc.SettingError, match="lpcmci and candoit"):
        rc.discover(x, method="pcmci", test="parcorr", max_sets=1)


def test_the_page_of_a_notebook_names_the_level_that_decided():
    x = np.random.default_rng(5).normal(size=(200, 2))
    for method, level in (("pcmci", "alpha 0.05"), ("pcmciplus", "pc_alpha 0.01")):
        assert f", {level}, " in rc.discover(x, method=method, test="parcorr")._repr_html_()
    assert ", pc_alpha 0.05, " in rc.discover(x, method="pcmciplus", test="parcorr", alpha=0.05)._repr_html_()


@pytest.mark.parametrize(("given", "says"), [({"exogenous": [2]}, "exogenous"), ({"alpha": float("nan")}, "'alpha': nan"), ({"max_sets": 0, "method": "lpcmci"}, "max_sets")])
def test_a_setting_of_the_wrong_kind_is_refused_by_its_name(given, says):
    x = np.random.default_rng(5).normal(size=(200, 2))
    with pytest.raises(rc.SettingError, match=says):
        rc.discover(x, **({"method": "pcmci", "test": "parcorr"} | given))


def test_settings_of_reading_are_keywords(chain, quick):
    columns = {name: chain[:, k] for k, name in enumerate("abc")}
    some = rc.discover({**columns, "on": np.arange(300) % 4 > 0}, where="on > 0", columns=list("abc"), **quick)
    assert some.links[0].n_used < rc.discover(columns, **quick).links[0].n_used and some.features == ["a", "b", "c"]
    assert rc.discover(columns, rows="1..150", **quick) == rc.discover({name: each[:150] for name, each in columns.items()}, **quick)
    changes = rc.discover(np.vstack([[[np.nan] * 3], np.diff(chain, axis=0)]), columns=list("abc"), **quick)
    assert np.allclose(rc.discover(chain, columns=list("abc"), difference=True, **quick).val_matrix, changes.val_matrix, equal_nan=True)
    added = rc.discover(columns, features=["s = a + c"], columns=["b"], **quick)
    assert set(added.features) == {"b", "s"}
    flagged = np.where(np.arange(300)[:, None] % 50 == 3, -999.0, chain)
    missing = rc.discover(np.where(flagged == -999, np.nan, flagged), **quick)
    assert np.array_equal(rc.discover(flagged, missing_value=-999, **quick).p_matrix, missing.p_matrix, equal_nan=True)
    with pytest.raises(rc.SettingError, match="where.*read already"):
        rc.discover(rc.Recordings(list("abc"), [chain]), where="a > 0", **quick)
    with pytest.raises(rc.SettingError, match="wher"):
        rc.discover(columns, wher="a > 0", **quick)


def test_a_test_of_the_moved_in_user_is_a_test(chain, quick):
    from roscausal.tigramite.independence_tests.parcorr import ParCorr

    own = rc.discover(chain, method="pcmci", test=ParCorr(), tau_max=2)
    assert np.array_equal(own.p_matrix, rc.discover(chain, **quick).p_matrix, equal_nan=True)
    assert own.settings["cond_ind_test"] == "parcorr"


def test_constant_and_doubled_columns_are_remarks(chain, quick):
    model = rc.discover(np.column_stack([chain, np.ones(300), 2 * chain[:, 0]]), **quick)
    assert any("x0 and x4 say the same" in each for each in model.warnings)
    assert any("x3" in each for each in model.warnings), model.warnings


def test_copies_and_pickles_keep_the_data_and_the_fit(chain, quick):
    model = rc.discover(chain, columns=list("abc"), **quick)
    for again in (copy.copy(model), copy.deepcopy(model), pickle.loads(pickle.dumps(model))):
        assert again == model and again.predict(3)["go on"]["b"].mean.shape == (3,)
        assert "svg" in again.series()._repr_svg_()
    structural = model.structural()
    for again in (copy.deepcopy(structural), pickle.loads(pickle.dumps(structural))):
        assert np.array_equal(again.effect("a", "b").total, structural.effect("a", "b").total)


def test_rows_of_lists_and_numbers_as_names_are_data(chain, quick):
    assert rc.discover(chain.tolist(), **quick) == rc.discover(chain, **quick)
    assert rc.discover(chain, columns=[0, 1, 2], **quick).features == ["0", "1", "2"]
    with pytest.raises(rc.SettingError, match="exogenous.*one word"):
        rc.discover(chain, exogenous="ab", **quick)
