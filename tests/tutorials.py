#!/usr/bin/env python3
"""tests/tutorials.py NOTEBOOK...: tutorials of tigramite, from a checkout of it that you have, run cell by cell twice: as they are,
and with their imports from roscausal.tigramite. Prints which cells differ, which are refused by their name, and how many agree.

Needs tigramite, matplotlib and what the notebooks import beside them. Nothing of the notebooks enters this repository. A cell agrees
if the values of its names (numbers, words, arrays, lists and dicts of these) do. Modules that roscausal has not, such as
tigramite.plotting, stay tigramite's. Where a cell was refused, those after it go on with tigramite's values.
  --seconds N   most time for a cell (60); a cell that takes longer, or fails, in tigramite is not counted
  --least N     exit code 1 if fewer percent agree (90)
"""

import argparse
import collections
import contextlib
import importlib.util
import io
import json
import os
import pathlib
import pickle
import re
import signal
import subprocess
import sys
import tempfile
import warnings

import numpy as np

PLAIN = (str, bool, int, float, complex, np.generic, type(None))


def cells(path):
    notebook = json.loads(pathlib.Path(path).read_text())
    sources = ["".join(cell["source"]) for cell in notebook["cells"] if cell["cell_type"] == "code"]
    return [re.sub(r"^\s*[%!].*$", "", source, flags=re.M) for source in sources]


def ours(source):
    """The imports of modules that roscausal has, from there."""

    def has(name):
        try:
            return importlib.util.find_spec(f"roscausal.tigramite.{name}") is not None
        except NotImplementedError:
            return False

    def of_package(match):
        return f"from {'roscausal.' if has(match[1]) else ''}tigramite import {match[1]}"

    source = re.sub(r"from tigramite import (\w+)", of_package, source)
    return re.sub(r"\b(from|import) tigramite\.([\w.]+)", lambda m: f"{m[1]} {'roscausal.' if has(m[2]) else ''}tigramite.{m[2]}", source)


def plain(value, depth=0):
    """The value without what cannot be compared; raises TypeError where that is all."""
    if isinstance(value, PLAIN):
        return value.item() if isinstance(value, np.generic) else value
    if isinstance(value, np.ndarray) and value.dtype.kind in "fiubUc" and value.size < 5_000_000:
        return np.array(value)
    if depth < 6 and isinstance(value, dict):
        return {key if isinstance(key, (str, int, tuple)) else str(key): plain(one, depth + 1) for key, one in value.items()}
    if depth < 6 and type(value) in (list, tuple) and len(value) < 100_000:
        return type(value)(plain(one, depth + 1) for one in value)
    raise TypeError


def same(a, b):
    if isinstance(a, dict) and isinstance(b, dict):
        # What only one has, such as a key that the other's version lacks, is a difference.
        return a.keys() == b.keys() and all(same(a[key], b[key]) for key in a)
    if isinstance(a, (list, tuple)) and isinstance(b, (list, tuple)):
        return len(a) == len(b) and all(map(same, a, b))
    if isinstance(a, (list, tuple, np.ndarray)) or isinstance(b, (list, tuple, np.ndarray)):
        a, b = np.asarray(a), np.asarray(b)
        if a.shape != b.shape or (a.dtype.kind in "US") != (b.dtype.kind in "US"):
            return False
        return bool(np.all(a == b)) if a.dtype.kind in "US" else bool(np.allclose(a, b, rtol=1e-4, atol=1e-5, equal_nan=True))
    if isinstance(a, (float, int, np.number)) and isinstance(b, (float, int, np.number)):
        return bool(np.isclose(a, b, rtol=1e-4, atol=1e-5, equal_nan=True))
    return type(a) is type(b) and a == b


def run(path, theirs, seconds, out):
    """Runs the cells here and writes what became of each: its error, and the values of its names."""
    import matplotlib

    matplotlib.use("Agg")
    warnings.simplefilter("ignore")
    os.chdir(pathlib.Path(path).parent)
    known = pickle.loads(pathlib.Path(theirs).read_bytes()) if theirs else None

    def late(*_):
        raise TimeoutError(f"more than {seconds} s")

    signal.signal(signal.SIGALRM, late)
    space, found = {"__name__": "__main__"}, []
    for number, source in enumerate(cells(path)):
        error = None
        # Cells that draw numbers without a seed draw the same twice; the first one may set it for all.
        np.random.seed(number)
        signal.alarm(seconds)
        try:
            with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
                exec(compile(ours(source) if known else source, f"cell {number}", "exec"), space)
                matplotlib.pyplot.close("all") if "matplotlib.pyplot" in sys.modules else None
        except BaseException as problem:
            error = type(problem).__name__, str(problem).split("\n")[0][:300]
        signal.alarm(0)
        values = {}
        for name, value in space.items():
            with contextlib.suppress(TypeError):
                if not name.startswith("_"):
                    values[name] = plain(value)
        found.append((error, pickle.dumps(values)))
        pathlib.Path(out).write_bytes(pickle.dumps(found))
        if error and known and number < len(known) and not known[number][0]:
            # The next cells need what this one would have made: plain values of tigramite, and imports one by one.
            for line in ours(source).splitlines():
                if re.match(r"(from|import) ", line):
                    with contextlib.suppress(BaseException):
                        exec(line, space)
            earlier = pickle.loads(known[number - 1][1]) if number else {}
            made = {name: value for name, value in pickle.loads(known[number][1]).items() if not same(value, earlier.get(name))}
            space.update(made)


def compare(path, theirs, mine):
    """What became of each cell: a word, and for what differs or is refused, which."""
    before, refused = {}, False
    for number, (reference, own) in enumerate(zip(theirs, mine)):
        (failed, values), (error, own_values) = reference, own
        values, own_values = pickle.loads(values), pickle.loads(own_values)
        changed = {name for name, value in values.items() if name not in before or not same(value, before[name])}
        before = values
        if failed:
            yield number, "not counted", f"tigramite: {failed[0]}: {failed[1]}"
        elif error and error[0] in ("NotImplementedError", "NotCovered"):
            refused = True
            yield number, "refused", error[1]
        elif error and error[0] == "NameError" and refused:
            yield number, "refused", f"{error[1]}: a refused cell would have made it"
        elif error:
            yield number, "failed", f"{error[0]}: {error[1]}"
        else:
            differ = [name for name in sorted(changed) if not (name in own_values and same(values[name], own_values[name]))]
            yield number, "differs" if differ else "agrees", ", ".join(differ)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("notebooks", nargs="+")
    parser.add_argument("--seconds", type=int, default=60)
    parser.add_argument("--least", type=float, default=90)
    parser.add_argument("--theirs", help=argparse.SUPPRESS)
    parser.add_argument("--worker", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.worker:
        return run(given.notebooks[0], given.theirs, given.seconds, given.worker)
    count = collections.Counter()
    with tempfile.TemporaryDirectory() as folder:
        for path in map(os.path.abspath, given.notebooks):
            results = []
            for which in ("theirs", "ours"):
                out = os.path.join(folder, f"{which}.pickle")
                more = ["--theirs", os.path.join(folder, "theirs.pickle")] if which == "ours" else []
                subprocess.run([sys.executable, __file__, path, "--worker", out, "--seconds", str(given.seconds), *more], check=True, stdout=subprocess.DEVNULL)
                results.append(pickle.loads(pathlib.Path(out).read_bytes()))
            print(os.path.basename(path), flush=True)
            for number, word, which in compare(path, *results):
                count[word] += 1
                if word != "agrees":
                    print(f"  cell {number} {word}: {which}", flush=True)
    counted = sum(count.values()) - count["not counted"]
    share = 100 * count["agrees"] / max(counted, 1)
    print(", ".join(f"{word}: {n}" for word, n in sorted(count.items())) + f"; {share:.1f} % of {counted} agree")
    return int(share < given.least or count["failed"] > 0)


if __name__ == "__main__":
    sys.exit(main())
