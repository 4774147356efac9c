#!/usr/bin/env python3
"""What the Python package costs above its engine: the time of its import, and of `run_pcmci` beside that of the engine alone.

usage: python.py BENCH_CASE [RUNS]

Run it with the Python of an environment that has the wheel. BENCH_CASE is the program of
`cargo build --release -p roscausal_discovery --example bench_case`; RUNS is 20 unless given. Times are CPU seconds of one thread, the
least of the runs, so that other work on the machine counts little. Exit code 1 if an aim is missed: an import of 0.15 s with numpy's,
and 10 % + 1 ms above the engine.
"""

import json
import os
import pathlib
import subprocess
import sys
import tempfile
import time

os.environ["RAYON_NUM_THREADS"] = "1"

import numpy as np
from roscausal.tigramite import data_processing as pp
from roscausal.tigramite.independence_tests.gpdc import GPDC
from roscausal.tigramite.independence_tests.parcorr import ParCorr
from roscausal.tigramite.pcmci import PCMCI

# Test, its name for the engine, variables, samples, largest lag.
CASES = [(ParCorr, "parcorr", 3, 500, 1), (ParCorr, "parcorr", 5, 500, 2), (ParCorr, "parcorr", 20, 2000, 5), (GPDC, "gpdc", 3, 200, 1)]
IMPORT = "import time; start = time.process_time(); import {}; print(time.process_time() - start)"


def least(measure, runs):
    return min(measure() for _ in range(runs))


def imported(module):
    """CPU seconds of an import in a fresh interpreter."""
    run = subprocess.run([sys.executable, "-c", IMPORT.format(module)], capture_output=True, text=True, check=True)
    return float(run.stdout)


def system(n, length):
    """Each variable is driven by its past and by that of the one before it."""
    x = np.random.default_rng(20240101 + n).standard_normal((length, n))
    for t in range(1, length):
        x[t] += 0.4 * x[t - 1]
        x[t, 1:] += 0.5 * np.tanh(x[t - 1, :-1])
    return x


def main(bench_case, runs):
    numpy, whole = least(lambda: imported("numpy"), runs), least(lambda: imported("roscausal"), runs)
    print(f"import: {whole:.3f} s, of which numpy {numpy:.3f} s")
    missed = ["import"] if whole > 0.15 else []
    print("| work | engine, ms | Python, ms | above, ms | aim, ms |\n| --- | --- | --- | --- | --- |")
    for test, name, n, length, lag in CASES:
        data = system(n, length)
        with tempfile.TemporaryDirectory() as folder:
            file = pathlib.Path(folder) / "data.csv"
            np.savetxt(file, data, "%.17g", ",", header=",".join(f"X{i}" for i in range(n)), comments="")
            command = [bench_case, "pcmci", name, file, "1", str(lag)]
            engine = least(lambda: json.loads(subprocess.check_output(command))["cpu_s"], runs)
        pcmci = PCMCI(pp.DataFrame(data), test())

        def python():
            start = time.process_time()
            pcmci.run_pcmci(tau_min=1, tau_max=lag)
            return time.process_time() - start

        ours, aim = least(python, runs), 0.1 * engine + 0.001
        work = f"PCMCI + {test.__name__}, N = {n}, T = {length}, lag {lag}"
        print(f"| {work} | {1e3 * engine:.2f} | {1e3 * ours:.2f} | {1e3 * (ours - engine):.2f} | {1e3 * aim:.2f} |")
        missed += [work] if ours - engine > aim else []
    if missed:
        sys.exit(f"missed: {'; '.join(missed)}")


if __name__ == "__main__":
    if len(sys.argv) not in (2, 3):
        sys.exit(__doc__)
    main(sys.argv[1], int(sys.argv[2]) if len(sys.argv) == 3 else 20)
