#!/usr/bin/env python3
"""A causal model of every recording of a fleet, on one machine, on a Ray cluster or on a Dask cluster.

    python fleet.py recordings/ --out models/
    python fleet.py recordings/ --out models/ --on ray --workers 8
    python fleet.py s3://robots/2026-11 --out s3://robots/models --on dask --address tcp://scheduler:8786 --pool jpcmciplus

Each recording (.mcap, .bag, .db3, .csv, also in subfolders) is one task: fetch, read, analyse, write `models/NAME.json`. Then
`summary.csv` says of each link in how many recordings it was found, and `--pool METHOD` makes one model of all recordings together.
It may be stopped and started again at any time: what is there is kept. A task whose process or machine is lost is done again
elsewhere. The models are the same bytes wherever they were made.

Needs `roscausal` and `fsspec`, and what the places and clusters need: `s3fs`, `ray`, `distributed`. A store with its own
address is named by fsspec's variables: `FSSPEC_S3_ENDPOINT_URL=http://store:9000`.
"""

from __future__ import annotations

import argparse
import csv
import io
import json
import os
import pathlib
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, replace
from typing import Any

import fsspec
import roscausal as rc

KINDS = (".mcap", ".bag", ".db3", ".csv")
#: How often a task is tried again whose process was lost: one that breaks each process ends at last.
RETRIES = 3


@dataclass(frozen=True)
class Job:
    """One recording, and where its model goes. It travels to the worker."""

    name: str
    source: str
    model: str
    settings: dict[str, Any]
    reading: dict[str, Any]


@dataclass(frozen=True)
class Outcome:
    """How a job ended: `made`, `kept` from an earlier run, or `failed` with a sentence."""

    name: str
    what: str
    message: str = ""


def main() -> int:
    options = arguments()
    jobs = jobs_of(options)
    remember_settings(options)
    failed = set()
    with CLUSTERS[options.on](options) as run:
        for number, outcome in enumerate(run(analyse, jobs), 1):
            told = f": {outcome.message}" if outcome.message else ""
            print(f"{number} of {len(jobs)}: {outcome.name} {outcome.what}{told}", flush=True)
            if outcome.what == "failed":
                failed.add(outcome.name)
        good = [job for job in jobs if job.name not in failed]
        write(f"{options.out}/summary.csv", summary(good))
        if options.pool and good:
            try:
                write(f"{options.out}/pooled.json", pooled(dict(run(variables, good)), options))
            except ValueError as error:
                sys.exit(f"fleet: the models are there, but none of all recordings together: {error}")
    print(f"{len(good)} models in {options.out}/models, their links in {options.out}/summary.csv")
    if failed:
        print(f"{len(failed)} of {len(jobs)} recordings have no model; the sentences are above", file=sys.stderr)
    return 1 if failed else 0


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recordings", help="folder: a path, or an address that fsspec knows")
    parser.add_argument("--out", required=True, help="folder for the models, likewise")
    parser.add_argument("--on", choices=sorted(CLUSTERS), default="here", help="where the tasks run (default: here)")
    parser.add_argument("--workers", type=int, default=os.cpu_count(), help="processes of a cluster that is started for this run")
    parser.add_argument("--address", help="of a cluster that is there: ray://head:10001, auto, tcp://scheduler:8786")
    parser.add_argument("--pool", metavar="METHOD", help="one more model, of all recordings together: jpcmciplus, pcmci, ...")
    pairs = {"metavar": "NAME=VALUE", "type": pair, "action": "append", "default": []}
    parser.add_argument("--read", help="an option of rc.read, as in --read person=7", **pairs)
    parser.add_argument("--set", help="a setting of rc.discover, as in --set tau_max=3", **pairs)
    options = parser.parse_args()
    options.read, options.set = dict(options.read), dict(options.set)
    return options


def pair(text: str) -> tuple[str, Any]:
    """`tau_max=3` as ("tau_max", 3); what is not JSON is a word."""
    name, separator, value = text.partition("=")
    if not separator:
        raise argparse.ArgumentTypeError(f"'{text}' is not NAME=VALUE")
    try:
        return name, json.loads(value)
    except ValueError:
        return name, value


def jobs_of(options: argparse.Namespace) -> list[Job]:
    """One job for each recording, in the order of their names."""
    fs, root = fsspec.core.url_to_fs(options.recordings)
    paths = sorted(path for path in fs.find(root) if path.lower().endswith(KINDS)) if fs.isdir(root) else []
    if not paths:
        sys.exit(f"fleet: there are no recordings ({', '.join(KINDS)}) in {options.recordings}")
    settings = {"threads": 1, **options.set}
    names = [path[len(root) :].lstrip("/") for path in paths]
    return [
        Job(name, fs.unstrip_protocol(path), f"{options.out}/models/{name}.json", settings, options.read)
        for name, path in zip(names, paths, strict=True)
    ]


def remember_settings(options: argparse.Namespace) -> None:
    """Models of one folder have one kind of settings: those of the first run."""
    now = {"roscausal": rc.__version__, "set": options.set, "read": options.read}
    place = f"{options.out}/fleet.json"
    before = read_text(place)
    if before is None:
        write(place, json.dumps(now, indent=1) + "\n")
    elif json.loads(before) != now:
        sys.exit(f"fleet: {options.out} has models made with {json.loads(before)}, not with {now}; give another --out")


# The tasks: functions of a job, that run on any machine.


def analyse(job: Job) -> Outcome:
    """The model of one recording."""
    fs, path = fsspec.core.url_to_fs(job.source)
    # Which bytes the model is of: a recording that has changed since is analysed again.
    version = str(fs.checksum(path))
    if read_text(f"{job.model}.source") == version and exists(job.model):
        return Outcome(job.name, "kept")
    try:
        model = rc.discover(fetch(job), **job.settings)
    except ValueError as error:
        return Outcome(job.name, "failed", str(error))
    write(job.model, model.to_json())
    write(f"{job.model}.source", version)
    return Outcome(job.name, "made")


def variables(job: Job) -> tuple[str, rc.Recordings]:
    """The variables of one recording: a small part of it."""
    return job.name, fetch(job)


def fetch(job: Job) -> rc.Recordings:
    """Reads the recording, from a copy on this machine where it is not here."""
    fs, path = fsspec.core.url_to_fs(job.source)
    if "file" in fs.protocol:
        return read(path, job)
    with tempfile.TemporaryDirectory() as folder:
        copy = str(pathlib.Path(folder) / pathlib.PurePosixPath(path).name)
        fs.get_file(path, copy)
        return read(copy, job)


def read(path: str, job: Job) -> rc.Recordings:
    """The warnings name the recording, not the place where a machine had it: models are the same bytes everywhere."""
    found = rc.read(path, **job.reading)
    return replace(found, warnings=[warning.replace(path, job.name) for warning in found.warnings])


# What becomes of all models.


def summary(jobs: list[Job]) -> str:
    """In how many recordings each link was found, the most frequent first."""
    found: dict[tuple[str, str, int], list[float]] = {}
    for job in jobs:
        for link in json.loads(read_text(job.model))["links"]:
            found.setdefault((link["cause"], link["effect"], link["lag"]), []).append(link["value"])
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(["cause", "effect", "lag", "found_in", "recordings", "mean_value"])
    for (cause, effect, lag), values in sorted(found.items(), key=lambda each: (-len(each[1]), each[0])):
        table.writerow([cause, effect, lag, len(values), len(jobs), f"{sum(values) / len(values):.6g}"])
    return text.getvalue()


def pooled(recordings: dict[str, rc.Recordings], options: argparse.Namespace) -> str:
    """One model of all recordings, in the order of their names."""
    settings = {**options.set, "method": options.pool}
    return rc.discover([recordings[name] for name in sorted(recordings)], **settings).to_json()


# Files, here or in a store. A reader sees a whole file or none.


def write(place: str, text: str) -> None:
    fs, path = fsspec.core.url_to_fs(place)
    if "file" not in fs.protocol:
        # A store shows an object when all of it is there.
        fs.pipe_file(path, text.encode())
        return
    os.makedirs(os.path.dirname(path), exist_ok=True)
    part = f"{path}.{os.getpid()}.part"
    with open(part, "w", encoding="utf-8") as file:
        file.write(text)
    os.replace(part, path)


def read_text(place: str) -> str | None:
    fs, path = fsspec.core.url_to_fs(place)
    fs.invalidate_cache()
    try:
        return fs.cat_file(path).decode()
    except FileNotFoundError:
        return None


def exists(place: str) -> bool:
    fs, path = fsspec.core.url_to_fs(place)
    return fs.exists(path)


# Where the tasks run: each starts or joins a cluster, and gives a function of (task, jobs) that yields the results as they come.

Run = Callable[[Callable[[Job], Any], list[Job]], Iterator[Any]]


@contextmanager
def here(_: argparse.Namespace) -> Iterator[Run]:
    yield map


@contextmanager
def on_ray(options: argparse.Namespace) -> Iterator[Run]:
    import ray

    def run(task: Callable[[Job], Any], jobs: list[Job]) -> Iterator[Any]:
        remote = ray.remote(num_cpus=1, max_retries=RETRIES)(task)
        waiting = [remote.remote(job) for job in jobs]
        while waiting:
            ended, waiting = ray.wait(waiting)
            yield from ray.get(ended)

    where = {"address": options.address} if options.address else {"num_cpus": options.workers, "include_dashboard": False}
    with ray.init(log_to_driver=False, **where):
        yield run


@contextmanager
def on_dask(options: argparse.Namespace) -> Iterator[Run]:
    from distributed import Client, as_completed

    local = {"n_workers": options.workers, "threads_per_worker": 1, "dashboard_address": None}
    with Client(options.address) if options.address else Client(**local) as client:

        def run(task: Callable[[Job], Any], jobs: list[Job]) -> Iterator[Any]:
            for future in as_completed(client.map(task, jobs, pure=False, retries=RETRIES)):
                yield future.result()

        yield run


CLUSTERS: dict[str, Callable[[argparse.Namespace], AbstractContextManager[Run]]] = {"here": here, "ray": on_ray, "dask": on_dask}


if __name__ == "__main__":
    sys.exit(main())
