"""Questions to a causal model: what will happen, what if, how strongly, why."""

from __future__ import annotations

import json
import os
import pathlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from . import _native
from ._native import DataError, SettingError
from .data import Recordings
from .quick import as_json, whole

if TYPE_CHECKING:
    from typing_extensions import Self

#: How to take an answer: OK; NOT_SUPPORTED, the data do not reach there; AMBIGUOUS, it depends on a link whose direction is open.
Status = Literal["OK", "NOT_SUPPORTED", "AMBIGUOUS"]


@dataclass(frozen=True, eq=False)
class Forecast:
    """One variable, step by step. Arrays are (horizon,); the first is the next sample.

    Attributes:
        variable: Its name.
        mean: Expected value.
        lower: Lower end of the interval of 90 %.
        upper: Upper end of it.
        skill: Skill over the last value, measured on rows that the model had not seen; NaN where it was not measured.

    Example:
        >>> import numpy as np, roscausal as rc
        >>> rc.Forecast("gap", *np.zeros((4, 3))).mean.shape
        (3,)
    """

    variable: str
    mean: NDArray[np.float64]
    lower: NDArray[np.float64]
    upper: NDArray[np.float64]
    skill: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Outlook:
    """What one action leads to.

    Attributes:
        action: Its name.
        refused: Whether the data do not carry an answer; `forecasts` is empty then.
        forecasts: One for each variable that was asked for, for the steps that the data carry.
        supported_steps: Steps for which the data carry the answer.
        cost: Mean cost over the steps that the data carry for all ranked actions; NaN if refused.
        cost_lower: Lower end of its interval.
        cost_upper: Upper end of it.
        probability_limits: Probability of keeping all limits at every step.
        probability_best: Probability of being the cheapest action of those that can be taken.
        text: The same in words.

    Example:
        >>> import numpy as np, roscausal as rc
        >>> forecast = rc.Forecast("gap", *np.zeros((4, 3)))
        >>> rc.Outlook("stop", False, [forecast], 3, 0.2, 0.1, 0.3, 1.0, 0.8, "the gap stays")["gap"].mean.shape
        (3,)
    """

    action: str
    refused: bool
    forecasts: list[Forecast]
    supported_steps: int
    cost: float
    cost_lower: float
    cost_upper: float
    probability_limits: float
    probability_best: float
    text: str

    def __getitem__(self, variable: str) -> Forecast:
        for forecast in self.forecasts:
            if forecast.variable == variable:
                return forecast
        known = ", ".join(forecast.variable for forecast in self.forecasts)
        raise KeyError(f"{variable} is not in the answer, which has: {known or 'nothing, it was refused'}")


@dataclass(frozen=True, eq=False)
class _Answer:
    """What all answers share. `print` shows the command's text."""

    status: Status
    message: str
    caveats: list[str]
    _words: str = field(repr=False)

    @classmethod
    def _of(cls, found: dict[str, Any], words: str, **made: Any) -> Self:
        known = {**found, **made, "_words": words}
        return cls(**{one.name: known[one.name] for one in fields(cls)})

    def __str__(self) -> str:
        word = {"OK": "note", "AMBIGUOUS": "ambiguous", "NOT_SUPPORTED": "not supported by the data"}[self.status]
        note = _native.visible(f"{word}: {self.message}")
        return f"{self._words}\n{note}" if self.message else self._words

    def _repr_html_(self) -> str:
        from html import escape

        return f"<pre>{escape(str(self))}</pre>"


@dataclass(frozen=True, eq=False)
class WhatIf(_Answer):
    """What each action leads to. `print` shows the command's text; `answer["stop"]` is the outlook of an action.

    Attributes:
        status: How to take the answer: OK, NOT_SUPPORTED, AMBIGUOUS.
        message: Why it is not OK, in a sentence.
        caveats: What it rests on, one sentence each.
        outlooks: One for each action, in the order of the question.
        ranking: Places of the actions that can be taken, the best first; empty if none can, or if there is nothing to rank by.
        dt: Seconds per step, or None.

    Example:
        >>> import numpy as np, roscausal as rc
        >>> x = np.random.default_rng(5).normal(size=(300, 2))
        >>> x[1:, 1] += x[:-1, 0]
        >>> model = rc.discover(x, columns=["a", "b"], method="pcmci", test="parcorr", alpha=0.001).structural(equations="linear")
        >>> answer = model.whatif(["high: a=1", "low: a=-1"], 3, cost={"b": 1})
        >>> answer.status, answer.best.action, answer["low"]["b"].mean.shape
        ('OK', 'low', (3,))
    """

    outlooks: list[Outlook]
    ranking: list[int]
    dt: float | None

    @property
    def best(self) -> Outlook | None:
        """The best action, if there were costs or limits and one can be taken."""
        return self.outlooks[self.ranking[0]] if self.ranking else None

    def __getitem__(self, action: str) -> Outlook:
        for outlook in self.outlooks:
            if outlook.action == action:
                return outlook
        raise KeyError(f"{action} is not an action of the question, which has: {', '.join(o.action for o in self.outlooks)}")

    def to_pandas(self) -> Any:
        """All forecasts as a pandas table: action, variable, step (from 1), mean, lower, upper, skill.

        Raises:
            ImportError: pandas is not installed.
        """
        import pandas  # type: ignore[import-not-found, import-untyped, unused-ignore]

        rows = [
            (outlook.action, f.variable, k + 1, f.mean[k], f.lower[k], f.upper[k], f.skill[k])
            for outlook in self.outlooks
            for f in outlook.forecasts
            for k in range(len(f.mean))
        ]
        return pandas.DataFrame(rows, columns=["action", "variable", "step", "mean", "lower", "upper", "skill"])


@dataclass(frozen=True, eq=False)
class Effect(_Answer):
    """How strongly one variable drives another. Arrays are by lag, (max_lag + 1,), lag 0 first. `print` shows the command's text.

    Attributes:
        status, message, caveats: As in `WhatIf`.
        total: Effect of a unit pulse of the cause, by all paths.
        lower: Lower end of its interval of 90 %.
        upper: Upper end of it.
        direct: By the link itself.
        mediated: Variable on the paths to what passes through it, at the lag of the largest total effect.
        adjustment_set: What the regression at that lag adjusts for, such as `h_dg(t-2)`.
        robustness: Part of the rest of cause and effect that an unrecorded cause would have to explain to undo the effect.

    Example:
        >>> import numpy as np, roscausal as rc
        >>> x = np.random.default_rng(5).normal(size=(300, 2))
        >>> x[1:, 1] += x[:-1, 0]
        >>> model = rc.discover(x, columns=["a", "b"], method="pcmci", test="parcorr", alpha=0.001).structural(equations="linear")
        >>> found = model.effect("a", "b", 2)
        >>> bool(abs(found.total[1] - 1) < 0.2), found.total.shape
        (True, (3,))
    """

    total: NDArray[np.float64]
    lower: NDArray[np.float64]
    upper: NDArray[np.float64]
    direct: NDArray[np.float64]
    mediated: dict[str, float]
    adjustment_set: list[str]
    robustness: float


@dataclass(frozen=True)
class Contribution:
    """One variable's part in a change.

    Attributes:
        variable: Its name.
        value: What its surprise added.
        lower: Lower end of the interval of 90 %.
        upper: Upper end of it.
        text: The same in words.

    Example:
        >>> import roscausal as rc
        >>> rc.Contribution("d", 0.3, 0.1, 0.5, "0.3 because d was larger than expected").value
        0.3
    """

    variable: str
    value: float
    lower: float
    upper: float
    text: str


@dataclass(frozen=True, eq=False)
class Explanation(_Answer):
    """A change of a variable, taken apart. `print` shows the command's text.

    Attributes:
        status, message, caveats: As in `WhatIf`.
        from_row: The row before the change.
        to_row: The row after it.
        change: How much the variable changed.
        expected: The part that was to be expected.
        contributions: The rest by variable, the strongest first.

    Example:
        >>> import numpy as np, roscausal as rc
        >>> x = np.random.default_rng(5).normal(size=(300, 2))
        >>> x[1:, 1] += x[:-1, 0]
        >>> model = rc.discover(x, columns=["a", "b"], method="pcmci", test="parcorr", alpha=0.001).structural(equations="linear")
        >>> found = model.explain("b", 100, 101)
        >>> parts = found.expected + sum(part.value for part in found.contributions)
        >>> bool(abs(parts - found.change) < 1e-9)
        True
    """

    from_row: int
    to_row: int
    change: float
    expected: float
    contributions: list[Contribution]


class StructuralModel:
    """A causal model that answers questions: its graph with an equation for each variable. `Model.structural` makes one.

    Args:
        native: The fitted model.

    Example:
        >>> import numpy as np, roscausal as rc
        >>> x = np.random.default_rng(5).normal(size=(400, 2))
        >>> for t in range(1, 400):
        ...     x[t, 0] += 0.5 * x[t - 1, 0]
        ...     x[t, 1] = 0.6 * x[t - 1, 1] - 0.4 * x[t - 1, 0] + 0.2 * x[t, 1]
        >>> model = rc.discover(x, columns=["speed", "gap"], method="pcmci", test="parcorr", alpha=0.001).structural()
        >>> answer = model.whatif(["stop: speed=0", "go on"], horizon=5, cost={"gap": -1})
        >>> answer.status, answer["stop"]["gap"].mean.shape
        ('OK', (5,))
        >>> bool(abs(model.effect("speed", "gap").total[1] + 0.4) < 0.1)
        True
    """

    def __init__(self, native: _native.Structural) -> None:
        self._native = native

    def __reduce__(self) -> tuple[Any, tuple[str]]:
        return (_read, (self._native.to_json(),))

    @property
    def names(self) -> list[str]:
        """Names of the variables."""
        return self._native.names()

    @staticmethod
    def fit(
        graph: str, data: Recordings, *, equations: Literal["auto", "linear", "gp"] = "auto",
        acts_on: Mapping[str, str] | None = None, seed: int = 42, threads: int | None = None,
    ) -> StructuralModel:  # fmt: skip
        """Fits an equation for each variable of a graph. `Model.structural` calls this with the graph that it found.

        Args:
            graph: A model's JSON, or links by hand: `{"links": [{"cause": "speed", "effect": "gap", "lag": 1}]}`.
            data: The rows to fit on.
            equations: "auto" (a Gaussian process where it predicts better than a line), "linear" or "gp".
            acts_on: Columns of interventions to the variable that each sets; None: the demo's.
            seed: Of all random numbers.
            threads: None: all cores. They do not change the result.

        Raises:
            DataError: A graph that is none, or data that lack a variable of it.
            SettingError: A setting that is not allowed.
        """
        own = None if acts_on is None else dict(acts_on)
        settings = {"equations": equations, "seed": seed, "threads": threads, "dt": data.dt, "acts_on": own}
        frame = _native.Frame(data.arrays, data.names)
        return StructuralModel(_native.Structural.fit(frame, graph, as_json(settings)))

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes the model with its rows; `StructuralModel.load`, the command and the nodes read it without a new fit.

        Args:
            path: Such as "structural.json".
        """
        pathlib.Path(path).write_text(self._native.to_json(), encoding="utf-8")

    @staticmethod
    def load(path: str | os.PathLike[str]) -> StructuralModel:
        """Reads a structural model's file.

        Args:
            path: What `save` or `roscausal predict --save` wrote.

        Raises:
            DataError: Another file.
            OSError: A file that cannot be read.
        """
        return _read(pathlib.Path(path).read_text(encoding="utf-8"))

    def _moment(self, at: int | None, recording: int) -> tuple[int, int]:
        rows = self._native.rows()
        if not -len(rows) <= recording < len(rows):
            raise DataError(f"there is no recording {recording}; there are {len(rows)}, counted from 0")
        recording %= len(rows)
        now = rows[recording] - 1 if at is None else at
        if not 0 <= now < rows[recording]:
            raise DataError(f"the recording has no row {at}; its rows are 0 to {rows[recording] - 1}")
        return recording, int(now)

    def predict(
        self, horizon: int = 10, *, variables: Sequence[str] = (), at: int | None = None, recording: int = -1, paths: int = 400,
        seed: int = 42,
    ) -> WhatIf:  # fmt: skip
        """What will happen if nobody acts. As `whatif` with the one action `go on`; so are the arguments.

        Returns:
            The outlook, under the action `go on`.
        """
        return self.whatif((), horizon, variables=variables, at=at, recording=recording, paths=paths, seed=seed)

    def whatif(
        self, actions: str | Sequence[str], horizon: int = 10, *, cost: Mapping[str, float] | None = None,
        limits: Sequence[str] = (), had: bool = False, variables: Sequence[str] = (), at: int | None = None,
        recording: int = -1, allow_extrapolation: bool = False, paths: int = 400, seed: int = 42,
    ) -> WhatIf:  # fmt: skip
        """What will happen under each action, and which is best.

        Args:
            actions: Such as "stop: r_v=0@1..10" (set), "slower: r_v+=-0.2" (shift), "ramp: r_v=0.6|0.4|0.2@1..3", "go on".
            horizon: Steps ahead.
            cost: Variable to weight; an action costs the weighted means over the steps.
            limits: Bounds to keep at every step, with a probability: "d>1.5:0.95".
            had: Had it been done: the rows after `at` again, with the noise that they had.
            variables: Those to show; none: all.
            at: The last row that is known; None: the last one.
            recording: Which recording; -1: the last.
            allow_extrapolation: Answer also where the data do not reach, and say so.
            paths: Simulated paths.
            seed: Of the paths.

        Returns:
            The answer. Its status is NOT_SUPPORTED where the data do not reach; look at it before you act.

        Raises:
            SettingError: A question that cannot be asked.
            DataError: Rows that the question needs are missing.
        """
        where = self._moment(at, recording)
        question = {
            "actions": [actions] if isinstance(actions, str) else list(actions), "horizon": horizon, "cost": dict(cost or {}),
            "limits": list(limits), "had": had, "variables": list(variables), "allow_extrapolation": allow_extrapolation,
            "paths": paths, "seed": seed,
        }  # fmt: skip
        text, words = self._native.what_if(as_json(question), *where)
        found = json.loads(text)
        return WhatIf._of(found, words, outlooks=[_outlook(each) for each in found["outlooks"]])

    def effect(self, cause: str, effect: str, max_lag: int = 10, *, standardised: bool = False) -> Effect:
        """How strongly one variable drives another: total, direct, and through others.

        Args:
            cause: Its name.
            effect: Its name.
            max_lag: Largest lag in steps.
            standardised: In standard deviations instead of units.

        Returns:
            The effect by lag.

        Raises:
            SettingError: A variable that is not there, a lag that is too large.
        """
        text, words = self._native.effect(cause, effect, whole("max_lag", max_lag), standardised)
        found = json.loads(text)
        arrays = {name: np.array(found[name], dtype=float) for name in ("total", "lower", "upper", "direct")}
        return Effect._of(found, words, **arrays, mediated=dict(zip(found["mediators"], found["mediated"])))

    def explain(
        self, variable: str, from_row: int | None = None, to_row: int | None = None, *, horizon: int = 10, recording: int = -1,
        seed: int = 42,
    ) -> Explanation:  # fmt: skip
        """Why a variable changed: the part of each other variable's surprise.

        Args:
            variable: Its name.
            from_row: The row before the change; without both rows: the largest change within the last `horizon` rows.
            to_row: The row after it.
            horizon: Rows to look back over.
            recording: Which recording; -1: the last.
            seed: Of all random numbers.

        Returns:
            The change, the part that was to be expected, and the rest by variable.

        Raises:
            SettingError: A variable that is not there, or only one row.
            DataError: Rows that are not there.
        """
        if (from_row is None) != (to_row is None):
            raise SettingError("give both rows of the change, or none for the largest one")
        recording, _ = self._moment(None, recording)
        rows = None if from_row is None or to_row is None else (whole("from_row", from_row), whole("to_row", to_row))
        text, words = self._native.explain(variable, recording, rows, whole("horizon", horizon), seed)
        found = json.loads(text)
        return Explanation._of(found, words, contributions=[Contribution(**each) for each in found["contributions"]])


def _read(text: str) -> StructuralModel:
    return StructuralModel(_native.Structural.read(text))


def _outlook(found: dict[str, Any]) -> Outlook:
    forecasts = [
        Forecast(each["variable"], *(np.array(each[name], dtype=float) for name in ("mean", "lower", "upper", "skill")))
        for each in found["forecasts"]
    ]
    costs = {name: float("nan") if found[name] is None else found[name] for name in ("cost", "cost_lower", "cost_upper")}
    return Outlook(**{**found, **costs, "forecasts": forecasts})
