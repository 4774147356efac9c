"""The questions of reasoning: CPU seconds of one call in one thread, this engine (`examples/reasoning_speed`) beside tigramite, dowhy and
antecedent on data of the same sizes. Called by compare.sh; prints the table in Markdown.

usage: reasoning.py REASONING_SPEED [--rows mediation3,...] [--cap SECONDS] [--list]
"""

import argparse
import contextlib
import importlib.metadata
import io
import os
import platform
import statistics
import subprocess
import sys
import time
import warnings

# One thread, also in the libraries below numpy.
for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[name] = "1"

# Row: what, the line of ours, the reference's call, its aim in seconds.
ROWS = {
    "mediation3": ("linear mediation, all measures, horizon 10, 3 variables x 1000", "mediation, horizon 10, 3 variables x 1000", ("mediation", 3, 1000), 0.0002),
    "mediation8": ("the same, 8 variables x 2000", "mediation, horizon 10, 8 variables x 2000", ("mediation", 8, 2000), 0.0005),
    "bootstrap3": ("its bootstrap, 100 samples, 3 variables x 1000", "its bootstrap, 100 samples, 3 variables x 1000", ("bootstrap", 3, 1000), 0.01),
    "bootstrap8": ("the same, 8 variables x 2000", "its bootstrap, 100 samples, 8 variables x 2000", ("bootstrap", 8, 2000), 0.03),
    "effect1": ("adjusted total effect, 3 variables, lag 1", "adjusted effect at lag 1, 3 variables x 1000", ("effect", 3, 1), 0.001),
    "effect3": ("the same, lag 3", "adjusted effect at lag 3, 3 variables x 1000", ("effect", 3, 3), 0.001),
    "effect5": ("the same, lag 5", "adjusted effect at lag 5, 3 variables x 1000", ("effect", 3, 5), 0.001),
    "graph5": ("the sets of the same from the graph alone, lag 4, a chain of 5 variables", "adjustment at lag 4, 5 variables", ("graph", 5, 4), 0.001),
    "graph6": ("the same, 6 variables", "adjustment at lag 4, 6 variables", ("graph", 6, 4), 0.001),
    "pulse": ("effects of a pulse at lags 0 to 3 with 200 bootstraps, 3 variables (antecedent: at lag 3)",
              "effect up to lag 3 with its bootstraps, Linear, 3 equations, 1000 rows", ("pulse", 3, 1000), 0.01),
    "gp": ("3 Gaussian processes on 600 rows, fit and 200 predictions each", "fit and 200 one-step answers, Gp, 3 equations, 600 rows",
           ("gp", 3, 800), 0.15),
    "gcmfit": ("fit of 3 linear equations (reference: dowhy, unrolled 10 steps)", "fit without bootstraps, Linear, 3 equations, 1000 rows", ("gcmfit", 3, 1000), 0.002),
    "fit20": ("the same with 20 bootstraps of it", "fit with 20 members, Linear, 3 equations, 1000 rows", None, None),
    "gcmdo": ("what-if, 1000 paths x 10 steps (dowhy)", "what-if, 1000 paths x 10, Linear, 3 equations, 1000 rows", ("gcmdo", 3, 1000), 0.005),
    "gcmhad": ("had-I, 10 steps (dowhy)", "had-I, 10 steps, Linear, 3 equations, 1000 rows", ("gcmhad", 3, 1000), 0.0005),
    "gcmwhy": ("explanation of a change (dowhy: anomaly attribution of one row)", "explain, Linear, 3 equations, 1000 rows", ("gcmwhy", 3, 1000), 0.002),
    "sustained": ("what-if, 400 paths x 3 steps, linear (antecedent refuses a sustained action)", "what-if, 400 paths x 3, Linear, 3 equations, 1000 rows", None, 0.005),
    "planning": ("what-if, 400 paths x 10 steps, 3 Gaussian processes of 500 rows", "what-if, 400 paths x 10, Gp, 3 equations, 502 rows", None, 0.06),
}


def system(n, rows):
    """Each variable drives itself and the next one, at lags 1 and 2: the system of reasoning_speed.rs."""
    import numpy as np

    noise = np.random.default_rng(7).standard_normal((rows, n))
    x = np.zeros((rows, n))
    for t in range(2, rows):
        cause = np.roll(x, 1, axis=1)
        x[t] = 0.5 * x[t - 1] + 0.6 * np.sin(cause[t - 1]) - 0.2 * cause[t - 2] + 0.5 * noise[t]
    return x


def parents(n):
    return {j: [(j, -1), ((j - 1) % n, -1), ((j - 1) % n, -2)] for j in range(n)}


def marks_of(links, tau_max):
    import numpy as np

    marks = np.full((len(links), len(links), tau_max + 1), "", dtype="<U3")
    for j, causes in links.items():
        for i, lag in causes:
            marks[i, j, -lag] = "-->"
    return marks


def tigramite(kind, n, size):
    import numpy as np
    from tigramite import data_processing as pp

    if kind == "graph":
        from tigramite.causal_effects import CausalEffects

        # A chain: on the ring of the other rows the reference takes minutes.
        links = {j: [(j, -1), (j - 1, -1)] if j else [(j, -1)] for j in range(n)}
        return lambda: CausalEffects(marks_of(links, 3), graph_type="stationary_dag", X=[(0, -size)], Y=[(1, 0)], verbosity=0)
    if kind == "effect":
        from sklearn.linear_model import LinearRegression
        from tigramite.causal_effects import CausalEffects

        frame = pp.DataFrame(system(n, 1000))

        def call():
            effects = CausalEffects(marks_of(parents(n), 2), graph_type="stationary_dag", X=[(0, -size)], Y=[(1, 0)], verbosity=0)
            effects.fit_total_effect(dataframe=frame, estimator=LinearRegression())
            effects.predict_total_effect(intervention_data=np.ones((1, 1)))
        return call
    frame = pp.DataFrame(system(n, size))
    if kind == "gp":
        from sklearn.gaussian_process import GaussianProcessRegressor
        from sklearn.gaussian_process.kernels import RBF, WhiteKernel
        from tigramite.models import Prediction

        def call():
            kernel = RBF() + WhiteKernel()
            model = Prediction(frame, train_indices=range(600), test_indices=range(600, 800), prediction_model=GaussianProcessRegressor(kernel=kernel))
            model.fit(target_predictors=parents(n), selected_targets=list(range(n)), tau_max=2)
            for target in range(n):
                model.predict(target)
        return call
    from tigramite.models import LinearMediation

    def fitted():
        model = LinearMediation(dataframe=frame)
        model.fit_model(all_parents=parents(n), tau_max=10)
        return model

    if kind == "mediation":
        def call():
            model = fitted()
            model.get_all_ace()
            model.get_all_acs()
            model.get_all_amce()
        return call

    def call():
        model = fitted()
        model.fit_model_bootstrap(boot_samples=100)
        for measure in ("get_all_ace", "get_all_acs", "get_all_amce"):
            model.get_bootstrap_of(measure, {})
    return call


def dowhy(kind, n, size):
    import networkx as nx
    import numpy as np
    import pandas
    from dowhy import gcm

    gcm.config.disable_progress_bars()
    gcm.config.set_default_n_jobs(1)
    steps = 10
    values = system(n, size)
    name = lambda var, step: f"x{var}_{step}"
    columns = {name(var, step): values[step : len(values) - steps + step, var] for step in range(steps) for var in range(n)}
    table = pandas.DataFrame(columns)
    arrows = [(name(i, step + lag), name(j, step)) for step in range(2, steps) for j, causes in parents(n).items() for i, lag in causes]

    def model():
        made = gcm.InvertibleStructuralCausalModel(nx.DiGraph(arrows))
        for node in made.graph.nodes:
            root = not list(made.graph.predecessors(node))
            mechanism = gcm.EmpiricalDistribution() if root else gcm.AdditiveNoiseModel(gcm.ml.create_linear_regressor())
            made.set_causal_mechanism(node, mechanism)
        return made

    if kind == "gcmfit":
        return lambda: gcm.fit(model(), table)
    fitted = model()
    gcm.fit(fitted, table)
    acts = {name(0, step): (lambda _: 0.2) for step in range(2, steps)}
    row = table.iloc[[-1]]
    if kind == "gcmdo":
        return lambda: gcm.interventional_samples(fitted, acts, num_samples_to_draw=1000)
    if kind == "gcmhad":
        return lambda: gcm.counterfactual_samples(fitted, acts, observed_data=row)
    return lambda: gcm.attribute_anomalies(fitted, name(1, steps - 1), anomaly_samples=row, num_distribution_samples=500)


def antecedent(n, size):
    import antecedent as library
    import numpy as np

    values = system(n, size)
    data = {f"x{j}": np.ascontiguousarray(values[:, j]) for j in range(n)}
    links = [(f"x{i}", -lag, f"x{j}", 0) for j, causes in parents(n).items() for i, lag in causes]
    query = library.PulseEffect("x0", "x1", treatment_lag=3)
    return lambda: library.analyze(data, query=query, graph=links, refute="none", threads=1, bootstrap=200)


def reference(kind, n, size):
    """Median CPU seconds of five calls, after one that is not counted, or one of those that take many seconds; prints them."""
    warnings.filterwarnings("ignore")
    with contextlib.redirect_stdout(io.StringIO()):
        call = antecedent(n, size) if kind == "pulse" else (dowhy if kind.startswith("gcm") else tigramite)(kind, n, size)
        times = []
        if kind != "graph":
            call()
        for _ in range(1 if kind == "graph" else 5):
            start = time.process_time()
            call()
            times.append(time.process_time() - start)
    print(statistics.median(times), flush=True)
    os._exit(0)


def main():
    if "--peer" in sys.argv:
        kind, n, size = sys.argv[2:5]
        reference(kind, int(n), int(size))
    parser = argparse.ArgumentParser(prog="compare.sh --reasoning")
    parser.add_argument("ours", help="the program reasoning_speed")
    parser.add_argument("--rows", default=",".join(ROWS), help="rows to run, by commas")
    parser.add_argument("--cap", type=float, default=300, help="seconds per cell")
    parser.add_argument("--list", action="store_true", help="list the rows")
    options = parser.parse_args()
    if options.list:
        for row, (what, *_) in ROWS.items():
            print(f"{row:12} {what}")
        return
    wanted = options.rows.split(",")
    unknown = [row for row in wanted if row not in ROWS]
    if unknown:
        sys.exit(f"unknown rows: {', '.join(unknown)}; --list shows them")
    said = subprocess.run([options.ours], check=True, capture_output=True, text=True).stdout
    ours = {line.rsplit(": ", 1)[0]: float(line.rsplit(": ", 1)[1].split()[0]) for line in said.splitlines() if ": " in line}
    with open("/proc/cpuinfo") as info:
        cpu = next((line.split(":")[1].strip() for line in info if line.startswith("model name")), platform.machine())
    peers = ", ".join(f"{p} {importlib.metadata.version(p)}" for p in ("tigramite", "dowhy", "antecedent", "numpy"))
    print(f"{cpu}; Python {platform.python_version()}, {peers}. CPU seconds of one call in one thread.\n")
    print("| call | ours | aim | reference | ratio |\n| --- | --- | --- | --- | --- |", flush=True)
    for row in wanted:
        what, line, call, aim = ROWS[row]
        mine, theirs, ratio = ours[line], "-", "-"
        if call:
            try:
                done = subprocess.run([sys.executable, __file__, "--peer", *map(str, call)], capture_output=True, text=True, timeout=options.cap)
                theirs = float(done.stdout.split()[-1]) if done.stdout.split() else (done.stderr.strip().splitlines() or ["no result"])[-1]
            except subprocess.TimeoutExpired:
                theirs = f"> {options.cap:.0f}"
        if isinstance(theirs, float):
            theirs, ratio = f"{theirs:.4g}", f"{theirs / mine:.0f} x"
        print(f"| {what} | {mine:.4g} | {'-' if aim is None else aim} | {theirs} | {ratio} |", flush=True)


main()
