"""Run time against size: each method and test over samples and over variables, beside the reference while it can be waited for.

Started by `compare.sh --sizes`. Prints a Markdown table and writes two pictures. A cell that does not end within the limit is the
last of its series: larger ones are not begun. The slope is that of the line through a series in the log-log plot, from its two
largest sizes."""

import argparse
import math
import os
import sys

import compare

# Method, test, data, smallest and largest lag; the reference has no F-PCMCI on many variables that ends within minutes.
SERIES = [
    ("pcmci", "parcorr", "var", 1, 1),
    ("pcmci", "gpdc", "chain", 1, 1),
    ("pcmci", "cmiknn", "chain", 1, 1),
    ("fpcmci", "parcorr", "var", 1, 1),
    ("fpcmci", "gpdc", "chain", 1, 1),
    ("pcmciplus", "parcorr", "var", 0, 1),
    ("lpcmci", "parcorr", "var", 0, 1),
    ("granger", "none", "var", 1, 1),
    ("varlingam", "none", "laplace", 0, 1),
    ("dynotears", "none", "laplace", 0, 1),
]
SAMPLES, OF_SAMPLES = [250, 500, 1000, 2000, 5000, 10_000, 20_000], 3
VARIABLES, OF_VARIABLES = [3, 10, 30, 100], 500
OURS, THEIRS = "#1c4fd6", "#c2410c"


def main():
    parser = argparse.ArgumentParser(prog="compare.sh --sizes")
    parser.add_argument("--work", required=True, help=argparse.SUPPRESS)
    parser.add_argument("--cap", type=float, default=60, help="seconds for one cell")
    parser.add_argument("--rows", help="series to run, by commas, such as pcmci-gpdc; all unless given")
    parser.add_argument("--pictures", default="target/compare", help="folder of the pictures")
    options = parser.parse_args()
    names = {f"{method}-{test}": series for series in SERIES for method, test in [series[:2]]}
    wanted = options.rows.split(",") if options.rows else list(names)
    if unknown := [name for name in wanted if name not in names]:
        sys.exit(f"unknown series: {', '.join(unknown)}; there are {', '.join(names)}")
    ours = f"{os.environ.get('CARGO_TARGET_DIR', 'target')}/release/examples/bench_case"
    print(f"CPU seconds of one analysis in one thread, one run each, at most {options.cap:.0f} s; ours / the reference.")
    axes = {
        "samples": (f"{OF_SAMPLES} variables", [(OF_SAMPLES, size) for size in SAMPLES], SAMPLES),
        "variables": (f"{OF_VARIABLES} samples", [(size, OF_VARIABLES) for size in VARIABLES], VARIABLES),
    }
    for axis, (fixed, shapes, sizes) in axes.items():
        print(f"\n| {fixed}; {axis}: | " + " | ".join(map(str, sizes)) + " | slope |")
        print("| --- |" + " --- |" * (len(sizes) + 1), flush=True)
        curves = {}
        for name in wanted:
            mine, theirs = (curve(options, names[name], shapes, command) for command in ([ours], reference()))
            curves[name] = (mine, theirs)
            cells = [f"{shown(a)} / {shown(b)}" for a, b in zip(mine, theirs)]
            print(f"| {name} | " + " | ".join(cells) + f" | {slope(sizes, mine)} / {slope(sizes, theirs)} |", flush=True)
        draw(f"{options.pictures}/speed-{axis}.svg", axis, fixed, sizes, curves)


def reference():
    return [sys.executable, compare.__file__, "--peer", "reference"]


def curve(options, series, shapes, command):
    """The seconds of each size: a number, or why there is none."""
    method, test, kind, tau_min, tau_max = series
    cells = []
    for n, length in shapes:
        if cells and isinstance(cells[-1], str):
            cells.append("-")
            continue
        path = compare.data_file(options.work, (kind, n, length))
        runs, failure = compare.measure([*command, method, test, path, str(tau_min), str(tau_max)], 1, options.cap)
        cells.append(runs[0]["cpu_s"] if runs else failure if failure.startswith(">") else "failed")
        if cells[-1] == "failed":
            print(f"{method}-{test}, {n} x {length}: {failure}", file=sys.stderr)
    return cells


def shown(cell):
    return cell if isinstance(cell, str) else f"{cell:.2g}"


def slope(sizes, cells):
    """Of the two largest sizes that ended."""
    known = [(size, cell) for size, cell in zip(sizes, cells) if not isinstance(cell, str)][-2:]
    if len(known) < 2:
        return "-"
    (size_a, a), (size_b, b) = known
    return f"{math.log(b / a) / math.log(size_b / size_a):.1f}"


def draw(path, axis, fixed, sizes, curves):
    """Ours as a line, the reference dashed, one panel for each method and test."""
    import matplotlib

    matplotlib.use("svg")
    matplotlib.rcParams["svg.hashsalt"] = "speed"
    from matplotlib import pyplot

    columns = min(5, len(curves))
    rows = math.ceil(len(curves) / columns)
    figure, panels = pyplot.subplots(rows, columns, figsize=(2.6 * columns, 2.4 * rows), sharex=True, sharey=True, squeeze=False)
    for panel in panels.flat[len(curves) :]:
        panel.set_axis_off()
    for panel, (name, pair) in zip(panels.flat, curves.items()):
        for cells, colour, style, label in zip(pair, (OURS, THEIRS), ("o-", "s--"), ("roscausal", "reference")):
            known = [(size, cell) for size, cell in zip(sizes, cells) if not isinstance(cell, str)]
            panel.loglog(*zip(*known) if known else ([], []), style, color=colour, label=label, markersize=3)
        panel.set_title(name.removesuffix("-none"), fontsize=9)
        panel.grid(alpha=0.3)
    panels.flat[0].legend(fontsize=7)
    figure.supxlabel(f"{axis} ({fixed})", fontsize=9)
    figure.supylabel("CPU seconds", fontsize=9)
    figure.tight_layout()
    figure.savefig(path, metadata={"Date": None})
    pyplot.close(figure)


if __name__ == "__main__":
    main()
