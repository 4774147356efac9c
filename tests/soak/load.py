"""Recording under load: `load.py ros1|ros2 NODES PEER SECONDS`: a robot node, a human node and a data node in processes
of their own, and a peer that sends odometry at 1 kHz, places at 100 Hz and 100 people at 25 Hz. The data node records all of
them, and 50 signals of their topics. Prints an account, and each node's share of a core and memory over time; ends with 1 when a
row is missing or has a hole, or a limit is passed.
"""

import csv
import os
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from faults import DT, ROBOT, Processes, batches, command, free_port, start_master

NODES = ["robot", "human", "data"]
PEOPLE = 100
LENGTH = 30.0
CORE_SHARE = 0.05  # of the data node
MEMORY_MB = 60  # of the data node
ODOMETRY, PLACE, TRACKS = "/mobile_base_controller/odom", "/robot_pose", "/ped/control/teleop_persons"
POSE = ["pose.pose." + field for field in ("position.x", "position.y", "position.z", "orientation.z", "orientation.w")]
TWIST = ["twist.twist." + field for field in ("linear.x", "linear.y", "linear.z", "angular.x", "angular.z")]
# 20 of odometry, 20 of places, 10 of people.
SIGNALS = [ODOMETRY + "." + field for field in POSE + TWIST] * 2 + [PLACE + "." + field for field in POSE] * 4
SIGNALS += ["count(%s.tracks)" % TRACKS] * 10
SIGNALS = ["s%d = %d * %s" % (i, i + 1, signal) for i, signal in enumerate(SIGNALS)]
GROWTH_MB = 10  # of any node, from the end of the third batch on


def figures(pid):
    """CPU seconds and megabytes so far."""
    with open("/proc/%d/stat" % pid) as file:
        fields = file.read().rsplit(")", 1)[1].split()
    with open("/proc/%d/status" % pid) as file:
        memory = int(re.search(r"VmRSS:\s+(\d+)", file.read())[1]) / 1000
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK"), memory


def start(processes, wire, program, peer, seconds, folder):
    given = {
        "robot": ROBOT,
        "human": {"source_frame": "map"},
        "data": {"data_dir": folder / "raw", "pp_data_dir": folder / "pp", "ts_length": LENGTH, "dt": DT, "sel_agent": "all",
                 "signals": "[%s]" % ", ".join(SIGNALS)},
    }
    env = {"ROS_DOMAIN_ID": "8", "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST", "ROS_LOCALHOST_ONLY": "1"}
    if wire == "ros1":
        env = start_master(processes, folder, free_port())
    for name in NODES:
        processes.start(name, command(wire, program, name, given[name]), env)
    arguments = {"ros1": ["sensors", str(seconds)], "ros2": ["--ros-args", "-p", "role:=sensors", "-p", "count:=%d" % seconds]}
    time.sleep(2)
    processes.start("peer", [peer, *arguments[wire]], env)


def holes(folder):
    """Rows and empty cells, without the last second, in which the sensors stop one after the other."""
    rows, empty = 0, []
    for path, _, _ in batches(folder):
        with open(path, newline="") as file:
            table = csv.DictReader(file)
            places = [name for name in table.fieldnames if re.fullmatch(r"r_x|h_\d+_x|s\d+", name)]
            assert len(places) == PEOPLE + 1 + len(SIGNALS), "%s has %d bodies and signals" % (path, len(places))
            for row in table:
                rows += 1
                empty.append(sum(row[name] in ("", "nan", "NaN") for name in places))
    return rows, sum(empty[: -round(1 / DT)])


def run(wire, program, peer, seconds, folder):
    with Processes(folder) as processes:
        start(processes, wire, program, peer, seconds, folder)
        processes.wait_for(lambda: any((folder / "raw").glob(".*journal")), 60, "a first row")
        pids = {name: processes.all[name].pid for name in NODES}
        begin, first = time.monotonic(), {name: figures(pid) for name, pid in pids.items()}
        last, settled, peak = first, None, dict.fromkeys(NODES, 0.0)
        while "sent" not in processes.log("peer"):
            time.sleep(1)
            last = {name: figures(pid) for name, pid in pids.items()}
            if settled is None and len(list((folder / "raw").glob("data_*.csv"))) >= 3:
                settled = {name: memory for name, (_, memory) in last.items()}
            peak = {name: max(peak[name], last[name][1]) for name in NODES}
            assert time.monotonic() < begin + 2 * seconds + 60, "the peer does not end"
        wall = time.monotonic() - begin
        time.sleep(2)
        sent = [int(word) for word in re.search(r"sent (\d+) (\d+) (\d+)", processes.log("peer")).groups()]
        for name in ["peer", *NODES]:
            processes.end(name)
        times = [t for _, batch, _ in batches(folder) for t in batch]
        rows, empty = holes(folder)
        missing = round((times[-1] - times[0]) / DT) + 1 - rows
        print("%s: %d odometry, %d places, %d times %d people, %d signals in %.0f s; %d rows out, %d missing, %d cells empty" % (
            wire, *sent, PEOPLE, len(SIGNALS), wall, rows, missing, empty), flush=True)
        for name in NODES:
            share = (last[name][0] - first[name][0]) / wall
            print("%s %s: %.1f %% of a core; %.0f MB at the start, %s after three batches, %.0f at the end, %.0f at the most" % (
                wire, name, 100 * share, first[name][1], "%.0f" % settled[name] if settled else "-", last[name][1], peak[name]), flush=True)
        assert rows >= (seconds - 3) / DT, "rows: %d" % rows
        assert missing == 0 and empty == 0, "rows have holes"
        assert (last["data"][0] - first["data"][0]) / wall <= CORE_SHARE, "the data node takes too much of a core"
        assert peak["data"] <= MEMORY_MB, "the data node takes too much memory"
        assert settled is None or all(last[name][1] < settled[name] + GROWTH_MB for name in NODES), "memory grows"


if __name__ == "__main__":
    wire, program, peer, seconds = sys.argv[1], os.path.abspath(sys.argv[2]), os.path.abspath(sys.argv[3]), int(sys.argv[4])
    with tempfile.TemporaryDirectory(prefix="roscausal-load-") as folder:
        try:
            run(wire, program, peer, seconds, Path(folder))
        except AssertionError as error:
            sys.exit("FAIL: %s" % error)
