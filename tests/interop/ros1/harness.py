"""What every group of ROS 1 interoperability tests needs: a roscore of its own, processes that are ended by
pid, waits with deadlines, and lines 'ok NAME' or 'FAIL NAME: reason'."""

import os
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
import traceback
import xmlrpc.client

PEER = os.environ["ROSCAUSAL_PEER"]
NODE = os.environ["ROSCAUSAL_NODE"]


def free_port():
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        return s.getsockname()[1]


def eventually(check, timeout=10.0, what="condition", period=0.02):
    """Polls check() and returns its first true value. Raises an error with `what` if there is none in time."""
    end = time.monotonic() + timeout
    while True:
        value = check()
        if value:
            return value
        if time.monotonic() > end:
            raise AssertionError("not within %g s: %s" % (timeout, what() if callable(what) else what))
        time.sleep(period)


class Process:
    """A child process whose output lines are kept. The end of the `with` block ends it."""

    alive = []

    def __init__(self, *command, env=None, cwd=None):
        self.lines = []
        self.child = subprocess.Popen(
            [str(part) for part in command], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
            errors="replace", env={**os.environ, **(env or {})}, cwd=cwd, stdin=subprocess.DEVNULL)
        self.reader = threading.Thread(target=self._read, daemon=True)
        self.reader.start()
        Process.alive.append(self)

    def _read(self):
        for line in self.child.stdout:
            self.lines.append(line.rstrip("\n"))

    @property
    def text(self):
        return "\n".join(self.lines)

    @property
    def pid(self):
        return self.child.pid

    def line(self, part, timeout=10.0, start=0):
        """Waits for an output line that contains `part`."""
        return eventually(
            lambda: next((line for line in self.lines[start:] if part in line), None), timeout,
            lambda: "a line with %r in the output:\n%s" % (part, self.text[-1500:]))

    def ended(self, timeout=10.0):
        eventually(lambda: self.child.poll() is not None, timeout, lambda: "the end of " + self.child.args[0])
        self.reader.join(2)
        return self.child.returncode

    def send(self, number):
        if self.child.poll() is None:
            self.child.send_signal(number)

    def end(self):
        for number, patience in ((signal.SIGINT, 15), (signal.SIGTERM, 5), (signal.SIGKILL, 5)):
            self.send(number)
            try:
                self.child.wait(patience)
                break
            except subprocess.TimeoutExpired:
                continue

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.end()
        Process.alive.remove(self)


def peer(*args, **more):
    return Process(PEER, *args, **more)


class Roscore:
    """A master (and /rosout) on a port of its own. It may be killed and restarted on the same port."""

    def __init__(self):
        self.port = free_port()
        self.dir = tempfile.mkdtemp(prefix="roscausal-ros-")
        os.environ.update(
            ROS_MASTER_URI="http://127.0.0.1:%d/" % self.port, ROS_IP="127.0.0.1", ROS_HOME=self.dir,
            ROS_LOG_DIR=self.dir + "/log")
        os.environ.pop("ROS_HOSTNAME", None)
        os.environ.pop("ROS_NAMESPACE", None)
        self.start()

    @property
    def master(self):
        # a new proxy each time, because proxies keep connections, which a restart breaks
        return xmlrpc.client.ServerProxy(os.environ["ROS_MASTER_URI"])

    def start(self):
        self.process = Process("/usr/bin/roscore", "-p", self.port)
        eventually(self.answers, 30, lambda: "roscore\n" + self.process.text)

    def answers(self):
        try:
            return self.master.getParam("/harness", "/rosdistro")[0] == 1
        except OSError:
            return False

    def stop(self):
        self.process.end()

    def nodes(self):
        state = self.master.getSystemState("/harness")[2]
        return {name for kind in state for _, names in kind for name in names}

    def param(self, name, value):
        assert self.master.setParam("/harness", name, value)[0] == 1


class Group:
    """Cases that share a roscore. run() prints a line per case and returns the number of failures."""

    def __init__(self):
        self.cases = []
        self.roscore = None

    def case(self, function):
        self.cases.append(function)
        return function

    def run(self, node=True):
        self.roscore = Roscore()
        failures = 0
        try:
            if node:
                import rospy
                rospy.init_node("tests", anonymous=True, disable_signals=True)
            only = sys.argv[1:]
            for case in self.cases:
                if only and case.__name__ not in only:
                    continue
                start = time.monotonic()
                name = case.__name__
                try:
                    note = case(self.roscore)
                    note = " (%s)" % note if note else ""
                    print("ok %s%s [%.1f s]" % (name, note, time.monotonic() - start), flush=True)
                except Exception as error:  # a failed case must not hide the others
                    failures += 1
                    where = traceback.extract_tb(error.__traceback__)
                    place = next((f for f in reversed(where) if "harness" not in f.filename), where[-1])
                    print("FAIL %s: %s (line %d)" % (name, error or type(error).__name__, place.lineno), flush=True)
                self.clean_up()
        finally:
            if node:
                import rospy
                rospy.signal_shutdown("done")
            self.roscore.stop()
        return failures

    def clean_up(self):
        """Ends what a case left behind, and deletes the private parameters of its nodes, which the master keeps."""
        for process in list(Process.alive):
            if process is not self.roscore.process:
                process.__exit__()
        master = self.roscore.master
        for name in master.getParamNames("/harness")[2]:
            if "/roscausal_" in name:
                master.deleteParam("/harness", name)
