"""Runs the rows of the comparison and prints a Markdown table. Started by compare.sh."""

import argparse
import importlib.metadata
import json
import os
import platform
import statistics
import subprocess
import sys
import time

for name in ("OMP", "OPENBLAS", "MKL", "NUMBA"):
    os.environ[f"{name}_NUM_THREADS"] = "1"
# The reference's resamples in its own process: CPU seconds of others would not be counted, and they would hold its pipe.
os.environ["LOKY_MAX_CPU_COUNT"] = "1"

# id: description, method, test, data, tau_min, tau_max, target ratio to the reference, target ratio to antecedent
ROWS = {
    "gpdc3": ("PCMCI + GPDC, 3 variables, T = 500, lag 1", "pcmci", "gpdc", ("chain", 3, 500), 1, 1, 100, 1),
    "fgpdc3": ("F-PCMCI + GPDC on the same", "fpcmci", "gpdc", ("chain", 3, 500), 1, 1, 100, None),
    "thor3": ("PCMCI + GPDC, a robot and a person (`thor`), 3 variables, T = 500, lag 1", "pcmci", "gpdc", ("thor", 3, 500), 1, 1, 100, None),
    "fthor3": ("F-PCMCI + GPDC on the same", "fpcmci", "gpdc", ("thor", 3, 500), 1, 1, 100, None),
    "thor1000": ("PCMCI + GPDC, a robot and a person (`thor`), 3 variables, T = 1000, lag 1", "pcmci", "gpdc", ("thor", 3, 1000), 1, 1, 100, None),
    "gpdc8": ("PCMCI + GPDC, 8 variables, T = 1000, lag 1", "pcmci", "gpdc", ("chain", 8, 1000), 1, 1, 80, None),
    "parcorr20": ("PCMCI + ParCorr, N = 20, T = 2000, lag 5", "pcmci", "parcorr", ("var", 20, 2000), 1, 5, 200, 2),
    "parcorr50": ("PCMCI + ParCorr, N = 50, T = 500, lag 5", "pcmci", "parcorr", ("var", 50, 500), 1, 5, 200, 2),
    "plus10": ("PCMCI+ + ParCorr, N = 10, T = 500, lags 0-5", "pcmciplus", "parcorr", ("var", 10, 500), 0, 5, 200, None),
    "lpcmci8": ("LPCMCI + ParCorr, N = 8, T = 500, lags 0-5", "lpcmci", "parcorr", ("var", 8, 500), 0, 5, 200, 1),
    "lpcmcigpdc": ("LPCMCI + GPDC, N = 4, T = 300, lags 0-1", "lpcmci", "gpdc", ("chain", 4, 300), 0, 1, 50, None),
    "candoit8": ("CAnDOIT + ParCorr, N = 8 and an intervention, T = 500, lags 0-2", "candoit", "parcorr", ("imposed", 8, 500), 0, 2, 200, None),
    "jpcmci": ("J-PCMCI+ + ParCorr, 4 variables, a context, 20 recordings of 200, lags 0-2", "jpcmciplus", "parcorr", ("people", 4, 4000), 0, 2, 200, None),
    "granger10": ("Granger, N = 10, T = 1000, lags 1-5", "granger", "none", ("var", 10, 1000), 1, 5, 1, None),
    "varlingam10": ("VARLiNGAM, N = 10, T = 1000, lags 0-2", "varlingam", "none", ("laplace", 10, 1000), 0, 2, 50, None),
    "dynotears10": ("DYNOTEARS, N = 10, T = 500, lags 0-1", "dynotears", "none", ("laplace", 10, 500), 0, 1, 20, None),
    "cmiknn3": ("PCMCI + CMIknn (shuffle), N = 3, T = 500", "pcmci", "cmiknn", ("chain", 3, 500), 1, 1, 20, None),
    "boot5": ("100 bootstraps of PCMCI + ParCorr, N = 5, T = 500, lags 1-2", "pcmci", "parcorr", ("var", 5, 500), 1, 2, 200, None),
}
# Rows that are resampled: how rows are drawn, and how often.
RESAMPLED = {"boot5": ("bootstrap", 100)}
# Measurements of our engine alone.
OWN = {
    "threads3": ("two threads against one, gpdc3 (wall)", ("chain", 3, 500), 1.7),
    "threads8": ("two threads against one, gpdc8 (wall)", ("chain", 8, 1000), 1.7),
    "memory": ("peak memory, gpdc3", ("chain", 3, 500), 30),
    "sub3": ("100 subsamples of PCMCI + GPDC, 3 variables, T = 500, lag 1 (CPU seconds)", ("chain", 3, 500), 8),
    "boot1000": ("peak memory of 1000 bootstraps of PCMCI + ParCorr, N = 5, T = 500, lags 1-2, above that of one run", ("var", 5, 500), 40),
    "threadsboot": ("two threads against one, 10000 bootstraps of the same (wall)", ("var", 5, 500), 1.8),
    "gpdc5840": ("GPDC, 8 variables x 5840 samples", ("chain", 8, 5840), 1000),
}


def make_data(kind, n, length):
    """A random system with a fixed seed. `chain` is nonlinear; each variable is driven by the previous one."""
    import numpy as np

    rng = np.random.default_rng(20240101 + 1000 * n + length)
    noise = rng.laplace(size=(length, n)) if kind == "laplace" else rng.standard_normal((length, n))
    x = np.zeros((length, n))
    if kind == "chain":
        for t in range(1, length):
            past = x[t - 1]
            x[t] = 0.4 * past + 0.6 * noise[t]
            x[t, 1:] += 0.8 * np.tanh(1.5 * past[:-1])
            x[t, 0] += 0.3 * np.cos(past[-1])
    else:
        # Two cross links per variable on average, at random lags; contraction keeps it stationary.
        links = [(rng.integers(n), j, rng.integers(1, 6), rng.choice([-0.2, 0.2])) for j in range(n) for _ in "ab"]
        # X0 is imposed in every other fifty rows.
        imposed = np.where((np.arange(length) // 50) % 2, 1.5, 0.0) if kind == "imposed" else np.zeros(length)
        for t in range(5, length):
            x[t] = 0.4 * x[t - 1] + noise[t]
            for i, j, lag, c in links:
                x[t, j] += c * x[t - lag, i]
            if imposed[t]:
                x[t, 0] = imposed[t]
    if kind == "imposed":
        x = np.column_stack([x, imposed])
    if kind == "people":
        # Recordings of 200 rows, each with a context and a level of its own.
        which = np.arange(length) // 200
        context = rng.standard_normal(length)[which]
        x = np.column_stack([x + 0.5 * context[:, None] + rng.standard_normal((length, n))[which], context, which])
    return x


def column_names(spec):
    names = [f"X{i}" for i in range(spec[1])]
    return names + {"imposed": ["do_X0"], "people": ["context", "recording"]}.get(spec[0], [])


def recorded(work, length):
    """The first batch of a run of the simulator, scenario `thor`: a table of its variables."""
    import glob
    import subprocess

    import numpy as np

    folder = f"{work}/thor{length}"
    program = f"{os.environ.get('CARGO_TARGET_DIR', 'target')}/release/roscausal"
    seconds = str(0.6 * length)
    subprocess.run([program, "demo", "--scenario", "thor", "--seed", "101", "--duration", seconds, "--out", folder],
                   check=True, capture_output=True)
    table = np.genfromtxt(sorted(glob.glob(f"{folder}/pp_pool/analysed/*.csv"))[0], delimiter=",", names=True)
    columns = np.column_stack([table[name] for name in table.dtype.names if name.startswith("h_")])
    return columns[np.isfinite(columns).all(1)]


def data_file(work, spec):
    import numpy as np

    path = f"{work}/{spec[0]}_{spec[1]}x{spec[2]}.csv"
    if not os.path.exists(path):
        names = ",".join(column_names(spec))
        values = recorded(work, spec[2]) if spec[0] == "thor" else make_data(*spec)
        np.savetxt(path, values, "%.17g", ",", header=names, comments="")
    return path


def reference(peer, method, test, path, tau_min, tau_max, resamples=0):
    """One warm-up on a short piece (compilation by numba, start of Java), then one timed run: CPU seconds."""
    import contextlib
    import io
    import warnings

    warnings.filterwarnings("ignore")
    import numpy as np

    data = np.loadtxt(path, delimiter=",", skiprows=1)
    names = [f"X{i}" for i in range(data.shape[1])]
    header = open(path).readline().strip().split(",")
    if method in ("granger", "varlingam", "dynotears"):
        run = linear(method, tau_max)
    elif peer == "antecedent":
        from antecedent import discovery

        kind = {"pcmci": "PCMCI", "lpcmci": "LPCMCI"}.get(method, "PCMCIPlus")
        kind = getattr(discovery, kind)

        def run(values):
            columns = {name: np.ascontiguousarray(values[:, i]) for i, name in enumerate(names)}
            kind(max_lag=tau_max, alpha=0.05, fdr=False, ci=test).run(columns, threads=1)
    else:
        from tigramite import data_processing as pp
        from tigramite.independence_tests.cmiknn import CMIknn
        from tigramite.independence_tests.gpdc import GPDC
        from tigramite.independence_tests.parcorr import ParCorr
        from tigramite.pcmci import PCMCI

        make = {"parcorr": ParCorr, "gpdc": GPDC, "cmiknn": lambda **kw: CMIknn(workers=1, **kw)}[test]

        def run(values, **options):
            if method == "fpcmci":
                from fpcmci.CPrinter import CPLevel
                from fpcmci.FPCMCI import FPCMCI
                from fpcmci.preprocessing.data import Data
                from fpcmci.selection_methods.TE import TE, TEestimator

                FPCMCI(
                    Data(values.copy(), vars=names), f_alpha=0.05, pcmci_alpha=0.05, min_lag=tau_min, max_lag=tau_max,
                    sel_method=TE(TEestimator.Gaussian), val_condtest=make(**options), verbosity=CPLevel.NONE,
                    neglect_only_autodep=True, resfolder=None,
                ).run()
                return
            if method in ("lpcmci", "candoit"):
                from tigramite.lpcmci import LPCMCI

                # CAnDOIT is LPCMCI with what is known of its context column.
                known = context_known(len(header), tau_max) if method == "candoit" else None
                LPCMCI(pp.DataFrame(values), make(**options), verbosity=0).run_lpcmci(
                    tau_min=tau_min, tau_max=tau_max, pc_alpha=0.05, link_assumptions=known
                )
                return
            if method == "jpcmciplus":
                joint(values, header, tau_max)
                return
            pcmci = PCMCI(pp.DataFrame(values), make(**options), verbosity=0)
            if resamples:
                settings = {"tau_min": tau_min, "tau_max": tau_max, "pc_alpha": 0.2}
                few = min(resamples, 2 if len(values) < len(data) else resamples)
                pcmci.run_bootstrap_of("run_pcmci", settings, boot_samples=few, boot_blocklength=1, seed=42)
            elif method == "pcmci":
                pcmci.run_pcmci(tau_min=tau_min, tau_max=tau_max, pc_alpha=0.2)
            else:
                pcmci.run_pcmciplus(tau_min=tau_min, tau_max=tau_max, pc_alpha=0.01)

    with contextlib.redirect_stdout(io.StringIO()):
        # Few samples, and few surrogates if there are any.
        piece = data[:600] if method == "jpcmciplus" else data[: 40 + 4 * tau_max]
        run(piece, **({"sig_samples": 10} if test == "cmiknn" else {}))
        start, wall = time.process_time(), time.time()
        run(data)
        result = {"cpu_s": time.process_time() - start, "wall_s": time.time() - wall}
    print(json.dumps(result), flush=True)
    os._exit(0)


def linear(method, tau_max):
    """The reference's models without independence tests."""
    if method == "granger":
        from statsmodels.tsa.api import VAR

        def run(values, **_):
            fit = VAR(values).fit(tau_max)
            for effect in range(values.shape[1]):
                for cause in range(values.shape[1]):
                    fit.test_causality(effect, cause, kind="f")
    elif method == "varlingam":
        import lingam

        def run(values, **_):
            lingam.VARLiNGAM(lags=tau_max, criterion=None, prune=True).fit(values)
    else:
        import numpy as np

        from_numpy_dynamic = dynotears()

        def run(values, **_):
            p = max(tau_max, 1)
            past = np.hstack([values[p - lag : len(values) - lag] for lag in range(1, p + 1)])
            from_numpy_dynamic(values[p:], past, lambda_w=0.1, lambda_a=0.1)

    return run


def dynotears():
    """causalnex's function. Importing the package would import PyTorch, which this part of it does not use."""
    import importlib.util
    import types

    where = importlib.util.find_spec("causalnex").submodule_search_locations[0]
    for name, folder in ("causalnex", where), ("causalnex.structure", f"{where}/structure"):
        sys.modules[name] = types.ModuleType(name)
        sys.modules[name].__path__ = [folder]
    from causalnex.structure.structuremodel import StructureModel

    sys.modules["causalnex.structure"].StructureModel = StructureModel
    from causalnex.structure.dynotears import from_numpy_dynamic

    return from_numpy_dynamic


def context_known(n, tau_max):
    """What is known of the last column, the context of the first: it drives that one, and its own past drives it."""
    last = n - 1
    known = {j: {} for j in range(n)}
    for j in range(last):
        for i in range(last):
            for lag in range(tau_max + 1):
                if lag or i != j:
                    known[j][i, -lag] = "o?>" if lag else "o?o"
    known[0][last, 0], known[last][0, 0], known[last][last, -1] = "-->", "<--", "-->"
    return known


def joint(values, header, tau_max):
    """J-PCMCI+ with a context and a dummy of space."""
    import numpy as np
    from tigramite import data_processing as pp
    from tigramite.independence_tests.parcorr_mult import ParCorrMult
    from tigramite.jpcmciplus import JPCMCIplus

    which, n = values[:, -1].astype(int), len(header) - 1
    parts = [values[which == k, :-1] for k in np.unique(which)]
    dummy = np.eye(len(parts))
    data = {k: np.column_stack([part, np.repeat(dummy[[k]], len(part), 0)]) for k, part in enumerate(parts)}
    vectors = {i: [(i, 0)] for i in range(n)} | {n: [(n + k, 0) for k in range(len(parts))]}
    frame = pp.DataFrame(data, vector_vars=vectors, analysis_mode="multiple")
    classes = {i: "system" for i in range(n - 1)} | {n - 1: "space_context", n: "space_dummy"}
    JPCMCIplus(dataframe=frame, cond_ind_test=ParCorrMult(), node_classification=classes, verbosity=0).run_jpcmciplus(
        tau_min=0, tau_max=tau_max, pc_alpha=0.01
    )


def measure(command, runs, cap):
    """Median of the runs that end within `cap` seconds in total; `None` and the reason if none does."""
    results, left = [], cap
    for _ in range(runs):
        start = time.time()
        try:
            done = subprocess.run(command, capture_output=True, text=True, timeout=left)
        except subprocess.TimeoutExpired:
            return (results, None) if results else ([], f"> {cap:.0f} s")
        left -= time.time() - start
        lines = [line for line in done.stdout.splitlines() if line.startswith("{")]
        if not lines:
            return results, (done.stderr.strip().splitlines() or ["no result"])[-1]
        results.append(json.loads(lines[-1]))
        if left <= 0:
            break
    return results, None


def median(results, key):
    return statistics.median(result[key] for result in results)


def show(results, reason, key="cpu_s"):
    return f"{median(results, key):.4g} ({len(results)})" if results else (reason or "-")


def compare(row, options, ours):
    what, method, test, spec, tau_min, tau_max, bar, bar_antecedent = ROWS[row]
    path = data_file(options.work, spec)
    arguments = [method, test, path, str(tau_min), str(tau_max)]
    drawn = ["1", *map(str, RESAMPLED[row])] if row in RESAMPLED else []
    mine, failure = measure([ours, *arguments, *drawn], options.runs, options.cap)
    columns = [what, show(mine, failure)]
    for peer, wanted in (("reference", bar), ("antecedent", bar_antecedent)):
        if wanted is None:
            columns += ["-", "-", "-"]
            continue
        command = [sys.executable, __file__, "--peer", peer, *arguments, *drawn[2:]]
        theirs, failure = measure(command, options.runs, options.cap)
        if mine and theirs:
            ratio = median(theirs, "cpu_s") / max(median(mine, "cpu_s"), 1e-9)
            columns += [show(theirs, None), f"{ratio:.1f} x", f"{wanted} x"]
        else:
            # A run that did not end in time still gives a lower bound.
            bound = f"> {options.cap / median(mine, 'cpu_s'):.0f} x" if mine and (failure or "").startswith(">") else "-"
            columns += [failure or "-", bound, f"{wanted} x"]
    print("| " + " | ".join(columns) + " |", flush=True)


def own(row, options, ours):
    what, spec, bar = OWN[row]
    if row in ("sub3", "boot1000", "threadsboot"):
        resampled(row, options, ours)
        return
    command = [ours, "pcmci", "gpdc", data_file(options.work, spec), "1", "1"]
    runs, failure = measure([*command, "1"], 1 if row == "gpdc5840" else options.runs, options.cap)
    if not runs:
        print(f"- {what}: {failure}", flush=True)
    elif row.startswith("threads"):
        both, failure = measure([*command, "2"], options.runs, options.cap)
        one, two = median(runs, "wall_s"), median(both, "wall_s") if both else float("nan")
        print(f"- {what}: {one:.3g} s and {two:.3g} s, {one / two:.2f} x (bar {bar} x)", flush=True)
    else:
        print(f"- {what}: {median(runs, 'peak_mb'):.1f} MB (bar {bar} MB), {median(runs, 'cpu_s'):.3g} CPU s", flush=True)


def resampled(row, options, ours):
    what, spec, bar = OWN[row]
    path = data_file(options.work, spec)

    def runs(test, tau_max, *drawn):
        results, failure = measure([ours, "pcmci", test, path, "1", tau_max, *drawn], options.runs, options.cap)
        if not results:
            sys.exit(f"{row}: {failure}")
        return results

    if row == "sub3":
        print(f"- {what}: {median(runs('gpdc', '1', '1', 'subsample', '100'), 'cpu_s'):.3g} s (bar {bar} s)", flush=True)
    elif row == "boot1000":
        many, one = (median(runs("parcorr", "2", *drawn), "peak_mb") for drawn in (["1", "bootstrap", "1000"], ["1"]))
        print(f"- {what}: {many - one:.1f} MB (bar {bar} MB)", flush=True)
    else:
        one, two = (median(runs("parcorr", "2", threads, "bootstrap", "10000"), "wall_s") for threads in "12")
        print(f"- {what}: {one:.3g} s and {two:.3g} s, {one / two:.2f} x (bar {bar} x)", flush=True)


def main():
    if "--peer" in sys.argv:
        peer, method, test, path, tau_min, tau_max = sys.argv[2:8]
        reference(peer, method, test, path, int(tau_min), int(tau_max), int((sys.argv[8:] or ["0"])[0]))
    parser = argparse.ArgumentParser(prog="compare.sh")
    parser.add_argument("--work", required=True, help=argparse.SUPPRESS)
    parser.add_argument("--rows", default=",".join([*ROWS, *OWN]), help="rows to run, by commas")
    parser.add_argument("--runs", type=int, default=5, help="runs per cell; the median counts")
    parser.add_argument("--cap", type=float, default=900, help="seconds per cell, all its runs together")
    parser.add_argument("--list", action="store_true", help="list the rows")
    options = parser.parse_args()
    if options.list:
        for row in {**ROWS, **OWN}:
            print(f"{row:12} {({**ROWS, **OWN})[row][0]}")
        return
    wanted = options.rows.split(",")
    unknown = [row for row in wanted if row not in ROWS and row not in OWN]
    if unknown:
        sys.exit(f"unknown rows: {', '.join(unknown)}; --list shows them")
    ours = "target/release/examples/bench_case"
    target = os.environ.get("CARGO_TARGET_DIR")
    if target:
        ours = f"{target}/release/examples/bench_case"
    with open("/proc/cpuinfo") as info:
        cpu = next((line.split(":")[1].strip() for line in info if line.startswith("model name")), platform.machine())
    version = importlib.metadata.version
    peers = ", ".join(f"{p} {version(p)}" for p in ("tigramite", "fpcmci", "idtxl-uv", "antecedent", "numpy", "numba"))
    print(f"{cpu}, {os.cpu_count()} cores; Python {platform.python_version()}, {peers}.")
    print(f"CPU seconds of one analysis in one thread, median of (n) runs, at most {options.runs} and {options.cap:.0f} s per")
    print("cell; all warmed up by a short run in the same process, which is not counted.\n")
    if any(row in ROWS for row in wanted):
        print("| work | ours | reference | ratio | bar | antecedent | ratio | bar |")
        print("| --- | --- | --- | --- | --- | --- | --- | --- |", flush=True)
    for row in wanted:
        if row in ROWS:
            compare(row, options, ours)
    print(flush=True)
    for row in wanted:
        if row in OWN:
            own(row, options, ours)


if __name__ == "__main__":
    main()
