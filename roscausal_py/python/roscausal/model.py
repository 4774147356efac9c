"""A causal model: links, matrices, and what it looks like as text, table, graph and picture."""

from __future__ import annotations

import csv
import io
import json
import os
import pathlib
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from . import _native
from ._native import DataError, SettingError
from .data import Recordings, recordings_of
from .page import page

if TYPE_CHECKING:
    from .reasoning import Effect, Explanation, StructuralModel, WhatIf


@dataclass(frozen=True)
class Link:
    """One link of a model.

    Attributes:
        cause: Name of the cause.
        effect: Name of the effect.
        lag: Steps from cause to effect.
        value: Strength; its range depends on the test. None if it was not tested.
        p_value: P-value; 0 means below the smallest that the test distinguishes. None if it was not tested.
        mark: `-->`, or `o-o` / `x-x` where the direction at lag 0 is open.
        n_lost: Samples left out because a value was missing.
        p: The p-value in words, such as "<0.001" where the test tells no smaller ones apart.
        confidence: Share of the resamples that have the link; None without resamples.
        value_low: Lower end of the strength's interval of 90 %; None without resamples.
        value_high: Upper end of it.
        size: With resamples `{step, change, low, high}`: this much more of the effect goes with a step more of the cause, in their units.
        since: Of a model of a node that rolls on: stamp from which on the link is in every model.
        seen: Of such a model: how many of the last eight models have the link.
        n_used: Samples that its test used, if known.
        required: Whether it was required beforehand; then it was not tested.
        chance: The chance that it is real, by the p-values of its run; None where that was not measured.

    Example:
        >>> import roscausal as rc
        >>> print(rc.Link("a", "b", 1, 0.5, 0.01, "-->", 0))
        a at t-1 drives b: strength 0.50, p = 0.010
    """

    cause: str
    effect: str
    lag: int
    value: float | None
    p_value: float | None
    mark: str = "-->"
    n_lost: int = 0
    p: str = ""
    confidence: float | None = None
    value_low: float | None = None
    value_high: float | None = None
    size: dict[str, Any] | None = field(default=None, hash=False)
    since: float | None = None
    seen: int | None = None
    n_used: int | None = None
    required: bool = False
    chance: float | None = None

    def __str__(self) -> str:
        when = f"at t-{self.lag}" if self.lag else "at the same time"
        effect, both = ("itself", "it at both times") if self.cause == self.effect else (self.effect, "both")
        if self.mark in ("-->", "o->"):
            hidden = f", or something not recorded drives {both}" if self.mark == "o->" else ""
            what = f"{self.cause} {when} drives {effect}{hidden}"
        elif self.mark == "<->":
            what = f"{self.cause} {when} and {self.effect}: something not recorded drives both"
        elif self.mark == "x->":
            what = f"{self.cause} {when} and {self.effect}: on whether it drives it the data contradict themselves"
        else:
            what = f"{self.cause} and {self.effect} depend on each other {when}, direction open"
        if self.value is None or self.p_value is None:
            return _native.visible(f"{what}: {'required, ' if self.required else ''}not tested")
        p = f"p < {self.p[1:]}" if self.p.startswith("<") else f"p = {self.p_value:.3f}"
        return _native.visible(f"{what}: strength {self.value:.2f}, {p}")


@dataclass(frozen=True)
class Advice:
    """What would settle a link that the resamples leave open.

    Attributes:
        cause: Name of the cause.
        effect: Name of the effect.
        lag: Steps from cause to effect.
        in_model: Whether the model has the link.
        confidence: Share of the resamples that have it.
        n_needed: Samples with which it would be found in four of five recordings, if it is real; None: no number can be told.
        n_low: Lower end of the range of 80 %.
        n_high: Upper end of that range; None: there is none.
        minutes: Minutes of recording more, where the step is known.
        minutes_low: Lower end of their range.
        minutes_high: Upper end of their range.
        sentence: All this in words.

    Example:
        >>> import numpy as np, roscausal as rc
        >>> x = np.random.default_rng(1).normal(size=(120, 2))
        >>> x[1:, 1] += 0.25 * x[:-1, 0]
        >>> model = rc.discover(x, columns=["a", "b"], method="pcmci", test="parcorr", resamples=20)
        >>> all(isinstance(advice, rc.Advice) for advice in model.advice)
        True
    """

    cause: str
    effect: str
    lag: int
    in_model: bool
    confidence: float
    n_needed: float | None
    n_low: float | None
    n_high: float | None
    minutes: float | None
    minutes_low: float | None
    minutes_high: float | None
    sentence: str


@dataclass(frozen=True)
class Picture:
    """A picture: notebooks show it, `save` writes it.

    Attributes:
        svg: The picture as an SVG document.

    Example:
        >>> import roscausal as rc
        >>> rc.Picture('<svg xmlns="http://www.w3.org/2000/svg" width="9" height="9"/>').png()[1:4]
        b'PNG'
    """

    svg: str = field(repr=False)

    def __post_init__(self) -> None:
        # Names such as $X^{12}$, as mathematics are written without a typesetter.
        raised = {letter: str.maketrans("0123456789+-", digits) for letter, digits in (("^", "⁰¹²³⁴⁵⁶⁷⁸⁹⁺⁻"), ("_", "₀₁₂₃₄₅₆₇₈₉₊₋"))}
        small = lambda found: (found[2] or found[3]).translate(raised[found[1]])
        plain = re.sub(r"\$([^$<>]{1,40})\$", lambda found: re.sub(r"([\^_])(?:\{([\d+-]+)\}|(\d))", small, found[1]), self.svg)
        object.__setattr__(self, "svg", plain)

    def _repr_svg_(self) -> str:
        return self.svg

    def png(self, scale: float = 2.0) -> bytes:
        """The picture as PNG of `scale` pixels per unit, with an embedded font. No SVG, or too large a picture, is a DataError."""
        return _native.picture(self.svg, scale)

    def pdf(self) -> bytes:
        """The picture as a PDF file of one page, with text that can be selected.

        Raises:
            DataError: No SVG.
        """
        return _native.pdf(self.svg)

    def save(self, path: str | os.PathLike[str], scale: float = 2.0) -> None:
        """Writes the picture.

        Args:
            path: A name that ends in .svg, .png or .pdf.
            scale: Pixels per unit of a PNG.

        Raises:
            SettingError: Another ending.
            OSError: The file cannot be written.
        """
        file = pathlib.Path(path)
        match file.suffix.lower():
            case ".svg":
                file.write_text(self.svg, encoding="utf-8")
            case ".png":
                file.write_bytes(self.png(scale))
            case ".pdf":
                file.write_bytes(self.pdf())
            case other:
                raise SettingError(f"setting 'path': '{other}' is not a picture format; give a name that ends in .svg, .png or .pdf")


class Model:
    """A causal model. It does not change; models with equal files are equal; it can be pickled.

    Args:
        text: The model's JSON, as `to_json` gives it.
        data: The recordings that it was found in, for `series`.

    Raises:
        DataError: Text that is not a model.

    Example:
        >>> import numpy as np, roscausal as rc
        >>> x = np.random.default_rng(3).normal(size=(200, 2))
        >>> x[1:, 1] += x[:-1, 0]
        >>> model = rc.discover(x, columns=["a", "b"], method="pcmci", test="parcorr")
        >>> model.features, str(model.graph[0, 1, 1]), model.val_matrix.shape
        (['a', 'b'], '-->', (2, 2, 2))
        >>> rc.Model(model.to_json()) == model
        True
    """

    def __init__(self, text: str, data: Recordings | None = None) -> None:
        self._file = _native.export(text, "json")
        # A text of an older version has become one of this.
        self._fields: dict[str, Any] = {**json.loads(self._file), "run_time_s": json.loads(text).get("run_time_s")}
        self._text = text
        self._data = data

    @property
    def features(self) -> list[str]:
        """Names of the N variables, in the order of the matrices."""
        return list(self._fields["features"])

    @property
    def dropped(self) -> list[str]:
        """Variables that were analysed but have no link; F-PCMCI leaves them out of `features`."""
        return list(self._fields["dropped"])

    @cached_property
    def links(self) -> list[Link]:
        """The links, in the order cause, effect, lag."""
        words = [row["p"] for row in csv.DictReader(io.StringIO(self.to_csv()))]
        return [Link(**link, p=p) for link, p in zip(self._fields["links"], words)]

    @cached_property
    def graph(self) -> NDArray[np.str_]:
        """Marks (N, N, tau_max + 1) as [cause, effect, lag]: "", "-->", "<--", "o-o", "x-x"."""
        return self._cube("graph", "<U3")

    @cached_property
    def val_matrix(self) -> NDArray[np.float64]:
        """Strengths (N, N, tau_max + 1) as [cause, effect, lag]; NaN where nothing was tested."""
        return self._cube("val_matrix", "f8")

    @cached_property
    def p_matrix(self) -> NDArray[np.float64]:
        """P-values (N, N, tau_max + 1) as [cause, effect, lag], corrected if a correction was asked for; NaN where nothing was
        tested."""
        return self._cube("p_matrix", "f8")

    @cached_property
    def n_matrix(self) -> NDArray[np.float64]:
        """Samples that each test used (N, N, tau_max + 1) as [cause, effect, lag]; NaN where nothing was tested, or they are not
        known."""
        return self._cube("n_matrix", "f8")

    @cached_property
    def outcomes(self) -> NDArray[np.str_]:
        """What became of each entry, (N, N, tau_max + 1) as [cause, effect, lag]: "tested", or why not: "not_asked" by the method,
        "required" or "forbidden" beforehand, "filtered", "no_answer" of the test, "ended" before, "unknown"."""
        return self._cube("outcomes", "<U9")

    @cached_property
    def link_frequency(self) -> NDArray[np.float64] | None:
        """Share of the resamples that have the link, (N, N, tau_max + 1) as [cause, effect, lag]; None without resamples."""
        return self._of_resamples("link_frequency")

    @cached_property
    def val_low(self) -> NDArray[np.float64] | None:
        """Percentile 5 of the strengths in the resamples, as [cause, effect, lag]; None without resamples."""
        return self._of_resamples("val_low")

    @cached_property
    def val_high(self) -> NDArray[np.float64] | None:
        """Percentile 95 of the strengths in the resamples, as [cause, effect, lag]; None without resamples."""
        return self._of_resamples("val_high")

    @property
    def advice(self) -> list[Advice]:
        """What would settle the links that the resamples leave open; empty without resamples."""
        return [Advice(**each) for each in self._fields.get("advice") or []]

    def _of_resamples(self, name: str) -> NDArray[np.float64] | None:
        return None if self._fields.get(name) is None else self._cube(name, "f8")

    def _cube(self, name: str, dtype: str) -> NDArray[Any]:
        n, lags = len(self._fields["features"]), self._fields["tau_max"] + 1
        cube = np.array(self._fields[name], dtype=dtype).reshape(n, n, lags)
        cube.flags.writeable = False
        return cube

    @property
    def summary(self) -> dict[str, Any]:
        """What may be said, as data: `conclusion` (sentences), `links` (firmest first, each with `sure`), `own_past`, `advice`,
        `about_data`, `notes`."""
        return dict(self._fields["summary"])

    @property
    def status(self) -> str:
        """`complete`, or `partial: ...` if the time budget ended the analysis."""
        return str(self._fields["status"])

    @property
    def dt(self) -> float | None:
        """Seconds per step, or None."""
        dt = self._fields["dt"]
        return None if dt is None else float(dt)

    @property
    def warnings(self) -> list[str]:
        """What a reader of the model should know, one sentence each."""
        data = self._fields.get("about_data") or {}
        still = [each["name"] for each in data.get("variables", []) if each["distinct"] == 1]
        constant = [f"{', '.join(still)}: one value only, so no link can be found there"] if still else []
        return [*self._fields["warnings"], *constant, *data.get("remarks", [])]

    @property
    def settings(self) -> dict[str, Any]:
        """The question: method, test, levels, lags, seed, samples, run time."""
        results = {
            "schema", "status", "features", "dropped", "links", "graph", "outcomes", "val_matrix", "p_matrix", "n_matrix", "causal_structure", "val",
            "pval", "warnings", "link_frequency", "mark_frequency", "summary_frequency", "majority_graph", "val_mean", "val_low",
            "val_high", "advice", "summary",
        }  # fmt: skip
        return {name: value for name, value in self._fields.items() if name not in results}

    def __str__(self) -> str:
        """The text that the command prints."""
        return _native.export(self._text, "text")

    def __repr__(self) -> str:
        method, test = self._fields["method"], self._fields["cond_ind_test"]
        size = f"{len(self.features)} variables, {len(self.links)} links"
        return _native.visible(f"<roscausal.Model {method} {test}: {size}>")

    def __eq__(self, other: object) -> bool:
        return self._file == other._file if isinstance(other, Model) else NotImplemented

    def __hash__(self) -> int:
        return hash(self._file)

    def __reduce__(self) -> tuple[type[Model], tuple[str, Recordings | None]]:
        return (Model, (self._text, self._data))

    def _repr_html_(self) -> str:
        return page(self, _native.export(self._text, "level"))

    def structural(
        self, data: Any = None, *, equations: Literal["auto", "linear", "gp"] = "auto",
        acts_on: Mapping[str, str] | None = None, seed: int = 42, threads: int | None = None,
    ) -> StructuralModel:  # fmt: skip
        """The model with an equation for each variable: it answers questions.

        Args:
            data: The rows to fit on, as for `rc.discover`; None: those that the model was found in.
            equations, acts_on, seed, threads: As in `StructuralModel.fit`.
        """
        from .reasoning import StructuralModel

        found = self._data if data is None else recordings_of(data)
        if found is None:
            raise DataError("the data of this model are not known: it comes from a file; give them: model.structural(data)")
        return StructuralModel.fit(self._file, found, equations=equations, acts_on=acts_on, seed=seed, threads=threads)

    @cached_property
    def _structural(self) -> StructuralModel:
        return self.structural()

    def predict(self, horizon: int = 10, **question: Any) -> WhatIf:
        """What will happen if nobody acts, after the last row of the data: `structural().predict`, which has all arguments."""
        return self._structural.predict(horizon, **question)

    def whatif(self, actions: str | Sequence[str], horizon: int = 10, **question: Any) -> WhatIf:
        """What will happen under each action, and which is best: `structural().whatif`, which has all arguments."""
        return self._structural.whatif(actions, horizon, **question)

    def effect(self, cause: str, effect: str, max_lag: int = 10, *, standardised: bool = False) -> Effect:
        """How strongly one variable drives another, by lag: `structural().effect`."""
        return self._structural.effect(cause, effect, max_lag, standardised=standardised)

    def explain(self, variable: str, from_row: int | None = None, to_row: int | None = None, **question: Any) -> Explanation:
        """Why a variable changed: `structural().explain`."""
        return self._structural.explain(variable, from_row, to_row, **question)

    def dag(self) -> Picture:
        """The summary graph: one node per variable, arrows with lags and strengths."""
        return Picture(_native.export(self._text, "dag"))

    def tsdag(self) -> Picture:
        """The time series graph: variables in rows, time in columns."""
        return Picture(_native.export(self._text, "tsdag"))

    def series(self, recording: int = 0) -> Picture:
        """The analysed series of one recording. A model from a file does not know its data."""
        if self._data is None:
            raise DataError("the data of this model are not known: it comes from a file; draw the series where it was found")
        if not 0 <= recording < len(self._data):
            raise DataError(f"there is no recording {recording}; there are {len(self._data)}, counted from 0")
        return Picture(_native.series(self._data.names, self._data[recording], self.dt))

    def plot(self, ax: Any = None) -> Any:
        """Draws the summary graph with matplotlib on these axes, or the current ones, and returns them."""
        import matplotlib.pyplot as plt  # type: ignore[import-not-found, import-untyped, unused-ignore]

        axes = plt.gca() if ax is None else ax
        axes.imshow(plt.imread(io.BytesIO(self.dag().png()), format="png"))
        axes.set_axis_off()
        return axes

    def to_json(self) -> str:
        """The bytes of `model.json`: the same data and seed give the same text. docs/model-schema.md describes it."""
        return self._file

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes the model's file, which `rc.load` and the command read.

        Args:
            path: Such as "model.json".
        """
        pathlib.Path(path).write_text(self._file, encoding="utf-8")

    def to_dict(self) -> dict[str, Any]:
        """The model as plain lists and dicts, with the fields of `to_json`."""
        return dict(json.loads(self._text))

    def to_dot(self) -> str:
        """The graph for Graphviz."""
        return _native.export(self._text, "dot")

    def to_graphml(self) -> str:
        """The graph for networkx, Gephi, yEd and igraph."""
        return _native.export(self._text, "graphml")

    def to_csv(self) -> str:
        """The links as a table with a header."""
        return _native.export(self._text, "csv")

    def to_pandas(self) -> Any:
        """The links as a pandas table, one row each, with the fields of `Link` as columns."""
        import pandas  # type: ignore[import-not-found, import-untyped, unused-ignore]

        columns = ["cause", "effect", "lag", "value", "p_value", "mark", "n_lost", "n_used", "confidence", "value_low", "value_high"]
        return pandas.DataFrame(self._fields["links"], columns=columns)

    def to_networkx(self) -> Any:
        """The graph as a networkx MultiDiGraph: edges have `lag`, `value`, `p_value`, `mark` and `confidence` (None without
        resamples). A link without direction is two edges with that mark."""
        import networkx  # type: ignore[import-not-found, import-untyped, unused-ignore]

        graph = networkx.MultiDiGraph()
        graph.add_nodes_from(self.features)
        for link in self.links:
            facts = {name: getattr(link, name) for name in ("lag", "value", "p_value", "mark", "confidence")}
            graph.add_edge(link.cause, link.effect, **facts)
            if link.mark != "-->":
                graph.add_edge(link.effect, link.cause, **facts)
        return graph

    def to_causal_learn(self) -> Any:
        """The graph as a GeneralGraph of causal-learn: a node `x(t-k)` for each variable and lag, each link at all times."""
        from causallearn.graph.Edge import Edge  # type: ignore[import-not-found, import-untyped, unused-ignore]
        from causallearn.graph.Endpoint import Endpoint  # type: ignore[import-not-found, import-untyped, unused-ignore]
        from causallearn.graph.GeneralGraph import GeneralGraph  # type: ignore[import-not-found, import-untyped, unused-ignore]
        from causallearn.graph.GraphNode import GraphNode  # type: ignore[import-not-found, import-untyped, unused-ignore]

        lags = range(self.graph.shape[2])
        nodes = {(name, lag): GraphNode(f"{name}(t-{lag})" if lag else name) for lag in lags for name in self.features}
        graph = GeneralGraph(list(nodes.values()))
        ends = {"-": Endpoint.TAIL, "<": Endpoint.ARROW, ">": Endpoint.ARROW}
        for link in self.links:
            first, last = (ends.get(end, Endpoint.CIRCLE) for end in (link.mark[0], link.mark[-1]))
            for time in lags[: len(lags) - link.lag]:
                graph.add_edge(Edge(nodes[link.cause, time + link.lag], nodes[link.effect, time], first, last))
        return graph

    def to_causalflow(self) -> Any:
        """The graph as a DAG of causalflow, whose pictures and simulators take it."""
        from causalflow.graph.DAG import DAG  # type: ignore[import-not-found, import-untyped, unused-ignore]

        graph = DAG(self.features, min((link.lag for link in self.links), default=1), self.graph.shape[2] - 1)
        for link in self.links:
            graph.add_source(link.effect, link.cause, link.value, link.p_value, link.lag, link.mark)
        return graph

    @staticmethod
    def from_msg(causal_model: Any, info: Any = None) -> Model:
        """The model of a ROS message `roscausal_msgs/CausalModel`, as rclpy, rospy or rosbags give it.

        Args:
            causal_model: The message. It holds the links only: of other pairs it is unknown whether they were tested.
            info: The `CausalModelInfo` published beside it, for the settings; None: they are unknown.
        """
        from .message import text_of

        return Model(text_of(causal_model, info))


def load(path: str | os.PathLike[str]) -> Model:
    """Reads a model's file.

    Args:
        path: A file that `Model.save`, the command or the discovery node wrote.

    Raises:
        DataError: A file that is not a model.
        OSError: A file that cannot be read.

    Example:
        >>> import numpy as np, os, tempfile, roscausal as rc
        >>> model = rc.discover(np.random.default_rng(1).normal(size=(99, 2)), method="pcmci", test="parcorr")
        >>> file = os.path.join(tempfile.mkdtemp(), "model.json")
        >>> model.save(file)
        >>> rc.load(file) == model
        True
    """
    return Model(pathlib.Path(path).read_text(encoding="utf-8"))
