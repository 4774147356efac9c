"""Faults of the middleware under the real nodes: `faults.py master|network PROGRAM SECONDS`.

master: a ROS master that is killed and started anew while ROS 1 nodes record; nothing may be lost.
network: a cable that is pulled between a simulator and recording ROS 2 nodes, each in a network namespace of its own;
only what was measured meanwhile may be missing. Prints an account; ends with 77 and the reason where it is not permitted.
"""

import csv
import json
import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
import xmlrpc.client
from pathlib import Path

DT = 0.1
LENGTH = 2.0
FEATURES = ["r_x = r.x", "r_y = r.y", "r_v = r.v"]
NODES = ["robot", "human", "data", "discovery"]


def skip(reason):
    print("SKIPPED: " + reason, flush=True)
    sys.exit(77)


class Processes:
    """Ends what was started here, and nothing else. Keeps the logs, and prints them if something goes wrong."""

    def __init__(self, folder):
        self.folder, self.all = folder, {}

    def __enter__(self):
        return self

    def __exit__(self, kind, error, trace):
        if kind:
            self.tell()
        self.kill()

    def start(self, name, command, env=None):
        log = open(self.folder / (name + ".log"), "a")
        child = subprocess.Popen(command, stdout=log, stderr=log, stdin=subprocess.DEVNULL, env={**os.environ, **(env or {})})
        self.all[name] = child
        return child

    def end(self, name, number=signal.SIGINT, patience=20):
        child = self.all.pop(name)
        if child.poll() is not None:
            raise SystemExit("FAIL: %s ended by itself with %s\n%s" % (name, child.returncode, self.log(name)))
        child.send_signal(number)
        try:
            return child.wait(patience)
        except subprocess.TimeoutExpired:
            child.kill()
            raise SystemExit("FAIL: %s does not end" % name)

    def wait_for(self, condition, patience, what):
        end = time.monotonic() + patience
        while not condition():
            for name, child in self.all.items():
                if child.poll() is not None:
                    raise SystemExit("FAIL: %s ended by itself with %s" % (name, child.returncode))
            if time.monotonic() > end:
                raise SystemExit("FAIL: %s, not within %d s" % (what, patience))
            time.sleep(0.1)

    def kill(self):
        for child in self.all.values():
            child.kill()
            child.wait()

    def tell(self):
        for name in self.all:
            print("%s:\n%s" % (name, self.log(name)), flush=True)

    def log(self, name):
        return (self.folder / (name + ".log")).read_text()[-2000:]


# The simulator's names, under ROS 1 and under ROS 2, whose defaults differ.
ROBOT = {"odom_topic": "/mobile_base_controller/odom", "pose_topic": "/robot_pose", "source_frame": "base_footprint",
         "goal_topic": "/goal_pose", "goal_type": "PoseStamped"}


def parameters(folder):
    """Parameters of each node. The simulator runs on wall time."""
    given = {
        "hrisim": {"clock": "false", "scenario": "thor", "duration": "100000"},
        "robot": ROBOT,
        "human": {"source_frame": "map"},
        "data": {
            "data_dir": folder / "raw", "pp_data_dir": folder / "pp", "ts_length": LENGTH, "dt": DT, "sel_agent": "all",
            "features": FEATURES,
        },
        "discovery": {
            "data_dir": folder / "pp", "res_dir": folder / "models", "cd_method": "pcmci", "cond_ind_test": "parcorr",
        },
    }
    return {node: {name: spelled(value) for name, value in values.items()} for node, values in given.items()}


def spelled(value):
    return json.dumps(value) if isinstance(value, list) else str(value)


def command(wire, program, node, values, *more):
    """Starts a node of one ROS with these parameters; `more` are further arguments of that ROS."""
    if wire == "ros1":
        return [program, node, *["_%s:=%s" % pair for pair in values.items()], *more]
    return [program, node, "--ros-args", *[part for pair in values.items() for part in ("-p", "%s:=%s" % pair)], *more]


def batches(folder):
    paths = sorted((folder / "raw").glob("data_*.csv"))
    for path in paths:
        with open(path, newline="") as file:
            rows = list(csv.reader(file))
        times = [float(row[rows[0].index("time")]) for row in rows[1:]]
        facts = json.loads(path.with_suffix(".json").read_text())
        assert facts["n_rows"] == len(times), path
        yield path, times, facts


def rows_after(folder, instant):
    return any(times and times[-1] > instant for _, times, _ in batches(folder))


def account(folder, begin, cut=None, late=15):
    """Checks that rows lie DT apart from the first, within `late` seconds, to the last. At `cut` there may be a gap."""
    recorded = list(batches(folder))
    times = [t for _, batch, _ in recorded for t in batch]
    complete = sum(facts["complete"] for _, _, facts in recorded)
    models = len(list((folder / "models").glob("*.json"))) if (folder / "models").is_dir() else 0
    waiting = len(list((folder / "pp").glob("data_*.csv")))
    gaps = [(a, b) for a, b in zip(times, times[1:]) if abs(b - a - DT) > 1e-3]
    span = times[-1] - times[0] if times else 0.0
    missing = round(sum(b - a for a, b in gaps) / DT) - len(gaps)
    print("%.0f s of messages in, %d rows out, %d missing, %d batches (%d complete), %d models, %d batches waiting" % (
        span, len(times), missing, len(recorded), complete, models, waiting), flush=True)
    assert times and times[0] < begin + late, "recording began late"
    # the last one, which is incomplete, may wait as well
    assert complete <= models + waiting <= len(recorded), "a batch without its model"
    for a, b in gaps:
        assert cut and cut[0] - 1.5 <= a and b <= cut[1] + 3.0, "rows from %.2f to %.2f are missing" % (a - begin, b - begin)


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def start_master(processes, folder, port):
    """Starts a ROS master and waits until it answers. Returns the environment for its nodes."""
    rosmaster = "/usr/bin/rosmaster"
    if not os.path.exists(rosmaster):
        skip("no ROS master here to start (Debian: apt-get install python3-rosmaster)")
    uri = "http://127.0.0.1:%d/" % port
    env = {"ROS_MASTER_URI": uri, "ROS_IP": "127.0.0.1", "ROS_HOME": str(folder), "ROS_LOG_DIR": str(folder)}
    processes.start("master", ["/usr/bin/python3", rosmaster, "--core", "-p", str(port)], env)

    def alive():
        try:
            return xmlrpc.client.ServerProxy(uri).getPid("/soak")[0] == 1
        except OSError:
            return False

    processes.wait_for(alive, 20, "a master that answers")
    return env


def master(program, seconds, folder):
    port = free_port()
    uri = "http://127.0.0.1:%d/" % port

    def registered():
        try:
            state = xmlrpc.client.ServerProxy(uri).getSystemState("/soak")[2]
        except OSError:
            return set()
        return {name for kind in state for _, names in kind for name in names}

    with Processes(folder) as processes:
        env = start_master(processes, folder, port)
        given = parameters(folder)
        wanted = {"/roscausal_" + name for name in NODES + ["hrisim"]}
        for name in NODES + ["hrisim"]:
            processes.start(name, command("ros1", program, name, given[name]), env)
        begin = time.time()
        processes.wait_for(lambda: rows_after(folder, begin), 30, "a first batch")
        stops = 0
        end = time.monotonic() + seconds
        while stops == 0 or time.monotonic() < end:
            processes.end("master", signal.SIGKILL)
            time.sleep(3)
            start_master(processes, folder, port)
            processes.wait_for(lambda: wanted <= registered(), 20, "nodes that are back: " + str(wanted))
            time.sleep(2)
            stops += 1
        last = time.time()
        processes.wait_for(lambda: rows_after(folder, last), 20, "rows after the restart")
        end_well(processes, folder)
        print("%d times the master was killed and started anew" % stops)
        account(folder, begin)


def end_well(processes, folder):
    """Ends the simulator first, and the others once every complete batch is analysed."""
    processes.end("hrisim")
    time.sleep(2)
    processes.wait_for(lambda: not list((folder / "pp").glob("data_*.csv")), 30, "models of all batches")
    for name in NODES:
        processes.end(name)


def network(program, seconds, folder):
    ours, theirs = "rcsoak%da" % os.getpid(), "rcsoak%db" % os.getpid()

    def ip(*args, check=True):
        return subprocess.run(["ip", *args], check=check, stderr=subprocess.PIPE, text=True)

    try:
        made = ip("netns", "add", ours, check=False)
    except FileNotFoundError:
        skip("no program 'ip' here to make network namespaces with (Debian: apt-get install iproute2)")
    if made.returncode:
        skip("network namespaces are not permitted here (%s)" % made.stderr.strip())
    try:
        run_network(program, seconds, folder, ip, ours, theirs)
    finally:
        for space in (ours, theirs):
            ip("netns", "del", space, check=False)


def run_network(program, seconds, folder, ip, ours, theirs):
    with Processes(folder) as processes:
        ip("netns", "add", theirs)
        ip("link", "add", "cable0", "netns", ours, "type", "veth", "peer", "name", "cable1", "netns", theirs)
        for space, cable, address in ((ours, "cable0", "10.77.0.1/24"), (theirs, "cable1", "10.77.0.2/24")):
            ip("-n", space, "addr", "add", address, "dev", cable)
            ip("-n", space, "link", "set", "lo", "up")
            ip("-n", space, "link", "set", cable, "up")
            ip("-n", space, "route", "add", "default", "dev", cable)
        given = parameters(folder)
        env = {"ROS_DOMAIN_ID": "7", "ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET", "ROS_LOCALHOST_ONLY": "0"}
        for name in NODES + ["hrisim"]:
            space = theirs if name == "hrisim" else ours
            processes.start(name, ["ip", "netns", "exec", space, *command("ros2", program, name, given[name])], env)
        begin = time.time()
        processes.wait_for(lambda: rows_after(folder, begin), 30, "a first batch")
        pulled = time.time()
        ip("-n", ours, "link", "set", "cable0", "down")
        time.sleep(max(5, seconds / 2))
        ip("-n", ours, "link", "set", "cable0", "up")
        ip("-n", ours, "route", "add", "default", "dev", "cable0", check=False)
        plugged = time.time()
        processes.wait_for(lambda: rows_after(folder, plugged), 30, "rows after the cable is back")
        back = min(t for _, times, _ in batches(folder) for t in times if t > plugged) - plugged
        time.sleep(3)
        end_well(processes, folder)
        print("the cable was out for %.1f s; the first row afterwards is of %.1f s after it was back" % (plugged - pulled, back))
        account(folder, begin, (pulled, plugged))


if __name__ == "__main__":
    what, program, seconds = sys.argv[1], os.path.abspath(sys.argv[2]), float(sys.argv[3])
    with tempfile.TemporaryDirectory(prefix="roscausal-soak-") as folder:
        try:
            {"master": master, "network": network}[what](program, seconds, Path(folder))
        except AssertionError as error:
            sys.exit("FAIL: %s" % error)
