"""The types of the settings of an analysis. Made from the table of settings by its tests."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import Any, Literal, TypedDict

Method = Literal[
    "fpcmci", "pcmci", "pcmciplus", "fullci", "bivci", "lagdep", "granger", "varlingam", "dynotears", "timino", "lpcmci",
    "candoit", "tsfci", "jpcmciplus",
]  # fmt: skip


class Settings(TypedDict, total=False):
    """What `rc.discover` takes beside the data and the test."""

    method: Method | str | None
    """Discovery method."""

    alpha: float | None
    """Significance level of a link, in (0, 1); where a method has one level only, that."""

    pc_alpha: float | Literal["auto"] | None
    """Significance level of the condition selection, in (0, 1); auto: chosen by a score; None: the method's own."""

    tau_min: int | None
    """Smallest lag, in steps."""

    tau_max: int | None
    """Largest lag, in steps; at most 100000."""

    f_alpha: float | None
    """Significance level of F-PCMCI's filter; None: the level of a link."""

    te_estimator: Literal["auto", "gaussian", "gaussian+dcor", "kraskov"] | None
    """Estimator of F-PCMCI's filter; auto: gaussian for a linear test, else gaussian+dcor."""

    neglect_only_autodep: bool | None
    """F-PCMCI's filter drops variables that depend on their own past only."""

    fdr: Literal["none", "fdr_bh", "fdr_bh_lagged"] | None
    """Correction for multiple testing."""

    exogenous: Sequence[str] | None
    """Columns that may be causes only (interventions, context), separated by commas."""

    acts_on: Mapping[str, str] | None
    """candoit: columns of interventions and the variable that each sets, separated by commas; None: do_robot_speed=r_v,
    do_robot_off=r_v, do_human_v=h_v, do_human_stop=h_v, as far as they are there."""

    extra_conditions: bool | None
    """candoit: contexts of interventions join their variables as conditions, as published; without, it takes far fewer tests."""

    levels: Literal["auto", "keep", "remove"] | None
    """Level and scale of each recording: auto takes them out where recordings differ, so that this makes no link; keep, remove.
    Batches of one run have one level."""

    links: str | os.PathLike[str] | Mapping[str, Any] | Sequence[Mapping[str, Any]] | None
    """File with what is known of links: required, forbidden, directed (docs/data.md); None: nothing is known."""

    vectors: Mapping[str, Sequence[str]] | None
    """parcorrmult: variables of several columns, separated by commas, such as place=x+y."""

    max_conds: int | None
    """Largest set of conditions in the condition selection (lpcmci: beyond those that are always there); None: no limit."""

    max_sets: int | None
    """lpcmci, candoit: sets of conditions of one size that are tested for a pair, from each of its ends; None: all."""

    collider_rule: Literal["majority", "conservative", "none"] | None
    """pcmciplus, jpcmciplus: how colliders are found."""

    conflict_resolution: bool | None
    """pcmciplus, jpcmciplus: orientations that contradict each other are marked x-x; without, the first one stays."""

    significance: Literal["analytic", "shuffle", "threshold"] | None
    """How a test gives its p-value; threshold: alpha is a threshold for the test's value; None: the test's own way."""

    shuffles: int | None
    """Surrogates of a shuffle test, or size of gpdc's null distribution, up to 1000000; None: 500; gpdc: no table."""

    sig_blocklength: int | None
    """Neighbouring rows that a shuffle test moves together; None: from the autocorrelation."""

    shuffle_stop: int | None
    """cmiknn: end the surrogates of a test once so many reach its value; the p-value is then their share of those drawn; None:
    all are drawn."""

    knn: float | None
    """cmiknn: number of nearest neighbours; below 1, a fraction of the samples."""

    shuffle_neighbors: int | None
    """cmiknn: neighbours among the conditions with which a surrogate exchanges its value."""

    transform: Literal["ranks", "uniform", "standardize", "none"] | None
    """cmiknn: what values are turned into before distances are measured."""

    categories: Sequence[str] | None
    """Variables whose values are categories, whatever they are; without, those of at most ten whole values are."""

    gp_search: Literal["default", "exact"] | None
    """How gpdc searches for the maximum of a likelihood; exact: every likelihood exact, slow; the same maxima."""

    gp_restarts: int | None
    """Extra random restarts of gpdc's optimiser; the best is kept; 0: the reference's answers."""

    null_dist: str | os.PathLike[str] | Mapping[int, Sequence[float]] | None
    """gpdc: null distributions to hold its values against, where the number of samples is one of theirs; columns separated by
    commas, the first row has the numbers of samples; None: gpdc's own."""

    as_tigramite: bool | None
    """Answer as tigramite also where it is known to be wrong, pool recordings as they are, and look for nothing else
    (docs/methods.md)."""

    seed: int | None
    """Seed of all random numbers."""

    resamples: int | None
    """Repeat the analysis on N resamples, 20 to 10000, and report how often each link appears; 0: off. 100 give a frequency to
    0.1. The analysis takes up to N times as long."""

    resampling: Literal["subsample", "bootstrap"] | None
    """How rows are drawn: a share of them, each once, or as many as there are, with replacement."""

    share: float | None
    """Share of the rows in a subsample, between 0 and 1."""

    block: int | str | None
    """Neighbouring rows that are drawn together: a number, or cube_root of the number of rows."""

    threads: int | None
    """Threads of the analysis; 0: all cores. They do not change the result."""

    time_budget: float | None
    """Seconds after which to stop with a partial result (roll: with the windows that came to their end); None: no limit."""

    max_memory: int | None
    """Memory that a test, a program of cd_method_dir, or the command's reading of files may take; what needs more is refused,
    in bytes; None: no limit; reading may take what is free."""
