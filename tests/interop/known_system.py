"""A system whose answers are known: the robot's speed drives the distance, the distance drives their speed. As a batch and as a graph
for the reasoning node; without ROS, for both versions."""

import json
import os
import random

DT = 0.3
NAMES = ("r_v", "d", "h_v")


LINKS = (("r_v", "r_v"), ("d", "d"), ("h_v", "h_v"), ("r_v", "d"), ("d", "h_v"))
#: Marks and lags that the link from the distance to their speed may have instead, as a graph may be written by hand.
MARKS = (("-->", 0), ("o-o", 0), ("x-x", 0))


def step(row, noise=(0.0, 0.0, 0.0)):
    """The next row."""
    r_v, d, h_v = row
    return (
        0.12 + 0.7 * r_v + noise[0],
        1.0 + 0.6 * d + 0.8 * r_v + noise[1],
        0.3 + 0.5 * h_v + 0.1 * d + noise[2],
    )


#: Noise of the three, and noise with which they reach all that a planner may try and a simulation shows: answers end where the data do.
QUIET, WIDE = (0.08, 0.05, 0.03), (0.28, 1.5, 0.4)


def rows(count, seed=1, noise=QUIET):
    rng = random.Random(seed)
    row, found = (0.4, 3.3, 1.2), []
    for _ in range(count):
        row = step(row, tuple(rng.gauss(0, sd) for sd in noise))
        found.append(row)
    return found


def expected(row, steps, r_v=None):
    """The means of the next rows; the robot's speed is set, if one is given."""
    found = []
    for _ in range(steps):
        row = step(row)
        if r_v is not None:
            row = (r_v, *row[1:])
        found.append(row)
    return found


def pulse(steps):
    """What one unit of r_v does to h_v this many steps later."""
    low, high = (0.0, 0.0, 0.0), (1.0, 0.0, 0.0)
    for _ in range(steps):
        low, high = step(low), step(high)
    return high[2] - low[2]


def links(last=("-->", 1)):
    """Cause, effect, lag and mark of each link; `last`: mark and lag of the last one."""
    return [(*pair, *((1, "-->") if pair != LINKS[-1] else (last[1], last[0]))) for pair in LINKS]


def write(folder, count=600, seed=1, last=("-->", 1), noise=QUIET):
    """A batch and a graph as files; their paths, and the rows."""
    batch, graph = os.path.join(folder, "batch.csv"), os.path.join(folder, "graph.json")
    found = rows(count, seed, noise)
    with open(batch, "w") as file:
        file.write("time," + ",".join(NAMES) + "\n")
        file.writelines(f"{100 + DT * i:.1f}," + ",".join(f"{x:.6f}" for x in row) + "\n" for i, row in enumerate(found))
    listed = [{"cause": cause, "effect": effect, "lag": lag, "mark": mark} for cause, effect, lag, mark in links(last)]
    with open(graph, "w") as file:
        json.dump({"variables": NAMES, "links": listed, "units": {"d": "m", "h_v": "m/s", "r_v": "m/s"}, "dt": DT}, file)
    return batch, graph, found
