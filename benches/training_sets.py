#!/usr/bin/env python3
"""How much the answers of docs/reasoning.md depend on the walks that a model was fitted on.

    benches/training_sets.py [PROGRAM] [--sets 50] [--walks 2] [--first 2001] [--seeds 101..120] [--starts 60,140.1]

Runs `roscausal experiment reasoning` once for each of so many sets of training walks, no walk in two sets, and always asks about the
same other walks. Prints each figure's median over the sets and its tenth worst (of 50 sets the 5th worst), and the same apart for the
sets in which the link `d -> h_v`, which is there, was found and missed.
"""
import argparse
import json
import pathlib
import statistics
import subprocess
import tempfile

# What is printed, its bar in figures.json, and whether much of it is bad.
FIGURES = [
    ("outcomes within their 90 % intervals", "outcomes within their 90 % intervals", False),
    ("error of the mean effect, of the correlation's", "error of the mean effect / that of the correlational answer", True),
    ("error of the single effect, of the correlation's", "error of the single effect / that of the correlational answer", True),
    ("error of had-I, of 'nothing would have changed'", "error of had-I / that of 'nothing would have changed'", True),
]


def measured(program: str, train: str, args: argparse.Namespace, folder: pathlib.Path) -> dict:
    """Each figure of one set, the share of moments that its data reach, and whether the link was found."""
    asked = ["--train", train, "--seeds", args.seeds, "--starts", args.starts, "--threads", "1", "--out", folder]
    subprocess.run([program, "experiment", "reasoning", *asked], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    figures = json.loads((folder / "figures.json").read_text())
    links = json.loads((folder / "model.json").read_text())["links"]
    values = {bar["what"]: bar["value"] for bar in figures["bars"]}
    found = any(link["cause"] == "d" and link["effect"] == "h_v" for link in links)
    return {"values": values, "reached": figures["reached"] / figures["moments"], "found": found}


def summary(sets: list[dict], what: str, much_is_bad: bool) -> str:
    """`median / tenth worst`."""
    if not sets:
        return "none"
    values = sorted((one["values"][what] for one in sets), reverse=much_is_bad)
    return f"{statistics.median(values):.2f} / {values[max(len(values) // 10 - 1, 0)]:.2f}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program", nargs="?", default="target/release/roscausal")
    parser.add_argument("--sets", type=int, default=50)
    parser.add_argument("--walks", type=int, default=2)
    parser.add_argument("--first", type=int, default=2001)
    parser.add_argument("--seeds", default="101..120")
    parser.add_argument("--starts", default="60,140.1")
    args = parser.parse_args()
    sets = []
    with tempfile.TemporaryDirectory() as folder:
        for k in range(args.sets):
            first = args.first + k * args.walks
            sets.append(measured(args.program, f"{first}..{first + args.walks - 1}", args, pathlib.Path(folder) / str(k)))
    found = [one for one in sets if one["found"]]
    missed = [one for one in sets if not one["found"]]
    reached = statistics.mean(one["reached"] for one in sets)
    print(f"{args.sets} sets of {args.walks} walks from {args.first} on; the data reach {100 * reached:.0f} % of the moments")
    print(f"| median / tenth worst | all | d -> h_v found ({len(found)}) | missed ({len(missed)}) |\n|---|---|---|---|")
    for words, what, much_is_bad in FIGURES:
        cells = " | ".join(summary(group, what, much_is_bad) for group in (sets, found, missed))
        print(f"| {words} | {cells} |", flush=True)


if __name__ == "__main__":
    main()
