"""Questions to a model: predict, what if, how strongly, why; the command's answers, number by number."""

import json
import pathlib
import subprocess
import sys

import numpy as np
import pytest

import roscausal as rc

COMMAND = pathlib.Path(sys.executable).parent / "roscausal"


@pytest.fixture(scope="module")
def robot():
    """Distance `d` shrinks with the robot's speed `r_v` of the step before."""
    x = np.random.default_rng(5).normal(size=(400, 2))
    for t in range(1, 400):
        x[t, 0] += 0.5 * x[t - 1, 0]
        x[t, 1] = 0.6 * x[t - 1, 1] - 0.4 * x[t - 1, 0] + 0.2 * x[t, 1]
    return x


@pytest.fixture(scope="module")
def model(robot):
    return rc.discover(robot, columns=["r_v", "d"], method="pcmci", test="parcorr", alpha=0.001)


@pytest.fixture(scope="module")
def asked(robot, model, tmp_path_factory):
    """Asks the command about the same model and rows."""
    folder = tmp_path_factory.mktemp("command")
    model.save(folder / "model.json")
    np.savetxt(folder / "rows.csv", robot, fmt="%.17g", delimiter=",", header="r_v,d", comments="")

    def ask(question, *flags):
        line = [COMMAND, question, "model.json", "--data", "rows.csv", *flags]
        run = subprocess.run([*line, "--format", "json"], cwd=folder, capture_output=True, text=True, check=True)
        words = subprocess.run(line, cwd=folder, capture_output=True, text=True, check=True)
        return json.loads(run.stdout), words.stdout.rstrip("\n")

    return ask


def test_a_prediction_is_the_commands(model, asked):
    found, words = asked("predict", "--horizon", "4")
    ours = model.predict(4)
    assert ours.status == "OK" and str(ours) == words
    for forecast, theirs in zip(ours["go on"].forecasts, found["outlooks"][0]["forecasts"]):
        for name in ("mean", "lower", "upper"):
            assert getattr(forecast, name).tolist() == theirs[name]


def test_actions_are_ranked_as_the_command_ranks_them(model, asked):
    actions = ["--action", "stop: r_v=0", "--action", "faster: r_v+=0.5"]
    found, words = asked("whatif", *actions, "--cost", "d:-1", "--limit", "d>-9:0.5", "--horizon", "5")
    ours = model.whatif(["stop: r_v=0", "faster: r_v+=0.5"], 5, cost={"d": -1}, limits=["d>-9:0.5"])
    assert [outlook.action for outlook in ours.outlooks] == ["stop", "faster"] and str(ours) == words
    assert ours.ranking == found["ranking"] and ours.best.action == ours.outlooks[ours.ranking[0]].action
    assert ours["stop"]["d"].mean.tolist() == found["outlooks"][0]["forecasts"][1]["mean"]
    assert ours["stop"]["r_v"].mean.tolist() == [0.0] * 5


def test_what_had_been_done_is_asked_of_rows_that_were_seen(model):
    had = model.whatif("stop: r_v=0", 3, had=True, at=300)
    assert had.status == "OK" and had["stop"]["d"].mean.shape == (3,)
    with pytest.raises(rc.DataError, match="had-I"):
        model.whatif("stop: r_v=0", 3, had=True)


def test_an_answer_that_the_data_do_not_carry_is_refused(model):
    far = model.whatif("race: r_v=99", 5)
    assert far.status == "NOT_SUPPORTED" and far["race"].refused and not far["race"].forecasts
    assert "not supported by the data" in str(far) and "race" in far._repr_html_()
    with pytest.raises(KeyError, match="refused"):
        far["race"]["d"]


def test_an_effect_is_the_commands_and_the_true_one(model, asked):
    found, words = asked("effect", "--cause", "r_v", "--effect", "d", "--max-lag", "3")
    ours = model.effect("r_v", "d", 3)
    assert ours.total.tolist() == found["total"] and str(ours) == words
    assert ours.total[1] == pytest.approx(-0.4, abs=0.05) and ours.lower[1] < ours.total[1] < ours.upper[1]


def test_an_explanation_is_the_commands_and_its_parts_are_the_change(model, asked):
    found, words = asked("explain", "--variable", "d", "--from", "100", "--to", "103")
    ours = model.explain("d", 100, 103)
    assert (ours.change, ours.expected, str(ours)) == (found["change"], found["expected"], words)
    assert ours.expected + sum(part.value for part in ours.contributions) == pytest.approx(ours.change)
    assert model.explain("d").to_row <= 399


@pytest.mark.parametrize(
    ("ask", "error", "message"),
    [
        (lambda m: m.whatif("stop: speed=0"), rc.SettingError, "speed"),
        (lambda m: m.whatif("nonsense"), rc.SettingError, "actions"),
        (lambda m: m.whatif("stop: r_v=0", limits=["d?3"]), rc.SettingError, "limits"),
        (lambda m: m.whatif("stop: r_v=0", cost={"d": "much"}), rc.SettingError, "cost"),
        (lambda m: m.predict(0), rc.SettingError, "horizon|steps"),
        (lambda m: m.predict(3, at=400), rc.DataError, "no row 400"),
        (lambda m: m.predict(3, recording=1), rc.DataError, "no recording 1"),
        (lambda m: m.effect("r_v", "nobody"), rc.SettingError, "nobody"),
        (lambda m: m.effect("r_v", "d", -1), rc.SettingError, "max_lag"),
        (lambda m: m.explain("d", 3), rc.SettingError, "both rows"),
        (lambda m: m.structural(equations="cubic"), rc.SettingError, "linear"),
        (lambda m: m.structural({"r_v": np.zeros(99), "w": np.ones(99)}), rc.DataError, "no variable 'd'"),
    ],
)
def test_questions_that_cannot_be_asked_are_errors(model, ask, error, message):
    with pytest.raises(error, match=message):
        ask(model)


def test_a_structural_model_stays_itself_through_a_file(model, robot, tmp_path):
    structural = model.structural(seed=7)
    structural.save(tmp_path / "structural.json")
    read = rc.StructuralModel.load(tmp_path / "structural.json")
    assert str(read.predict(3)) == str(structural.predict(3)) and read.names == ["r_v", "d"]
    with pytest.raises(rc.DataError, match="structural model"):
        model.save(tmp_path / "model.json")
        rc.StructuralModel.load(tmp_path / "model.json")
    with pytest.raises(rc.DataError, match="give them"):
        rc.load(tmp_path / "model.json").predict()
    assert rc.load(tmp_path / "model.json").structural({"r_v": robot[:, 0], "d": robot[:, 1]}).effect("r_v", "d").status == "OK"


def test_the_demos_model_answers():
    model = rc.demo()
    assert model.predict(3)["go on"]["h_v"].mean.shape == (3,)
    assert model.series().svg.startswith("<svg")
