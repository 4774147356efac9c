"""Runs the tests in this folder against real ROS 2. Each is a function marked @test. Has helpers to start our
programs and to wait with a deadline. Only processes that were started here are ended."""

import contextlib
import faulthandler
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
import traceback

import rclpy
from rclpy.executors import SingleThreadedExecutor

BIN = os.environ["ROSCAUSAL_BIN"]
PEER = os.environ["ROSCAUSAL_PEER"]
# colcon's install folder; it does not exist if the programs come from cargo alone
INSTALL = os.environ.get("ROSCAUSAL_INSTALL", "")
TESTS = []
# the programs that run now, to be ended with this one
RUNNING = set()
# [s] that a test may take; on a busy machine the longest takes 100
LONGEST = 300


def test(function):
    TESTS.append(function)
    return function


class Ros:
    """An rclpy node in its own context, spun by hand."""

    def __init__(self, name="tester", args=()):
        self.context = rclpy.Context()
        rclpy.init(context=self.context, args=list(args))
        self.node = rclpy.create_node(name, context=self.context)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)

    def until(self, condition, seconds, what):
        """Spins until the condition holds. If it never does, an AssertionError says what was missing. `seconds` are those of a
        quiet machine; a busy one gets three times as long."""
        end = time.monotonic() + 3 * seconds
        while not (value := condition()):
            assert time.monotonic() < end, f"{what() if callable(what) else what}: not within {seconds} s"
            self.executor.spin_once(timeout_sec=0.02)
        return value

    def spin(self, seconds):
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self.executor.spin_once(timeout_sec=0.02)

    def call(self, kind, name, request):
        client = self.node.create_client(kind, name)
        try:
            self.until(client.service_is_ready, 10, f"service {name}")
            # A ready client does not mean a ready server: ask again if there is no answer.
            for _ in range(5):
                future = client.call_async(request)
                with contextlib.suppress(AssertionError):
                    self.until(future.done, 2, "answer")
                    return future.result()
            raise AssertionError(f"no answer from {name}")
        finally:
            self.node.destroy_client(client)

    def names(self):
        return [ns.rstrip("/") + "/" + name for name, ns in self.node.get_node_names_and_namespaces()]

    def participants(self, name_part):
        """The DDS participants of the nodes whose names contain this, as far as topics show them."""
        return {prefix for prefix, name in self._endpoints() if name_part in name}

    def gone(self, name_part, participants):
        """Whether nothing is left of these nodes: neither a name nor a topic."""
        left = any(name_part in name for name in self.names())
        return not left and participants.isdisjoint(prefix for prefix, _ in self._endpoints())

    def _endpoints(self):
        for topic, _ in self.node.get_topic_names_and_types():
            for of_topic in (self.node.get_publishers_info_by_topic, self.node.get_subscriptions_info_by_topic):
                for endpoint in of_topic(topic):
                    yield bytes(endpoint.endpoint_gid)[:12], endpoint.node_name

    def close(self):
        self.executor.shutdown()
        self.node.destroy_node()
        rclpy.shutdown(context=self.context)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()


class Program:
    """One of our programs, its log in a file."""

    def __init__(self, command, env=None):
        self.log_file = tempfile.TemporaryFile("w+")
        self.process = subprocess.Popen(
            command, stdout=self.log_file, stderr=subprocess.STDOUT, env={**os.environ, **(env or {})}
        )
        RUNNING.add(self)

    def log(self):
        self.log_file.seek(0)
        return self.log_file.read()

    def send(self, number):
        self.process.send_signal(number)

    def end(self, number=signal.SIGINT, seconds=20):
        if self.process.poll() is None:
            self.process.send_signal(number)
        return self.wait(seconds)

    def wait(self, seconds=20):
        """The exit code, once the program has ended on its own or by a signal sent before."""
        try:
            return self.process.wait(seconds)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
            raise AssertionError(f"{self.process.args[0]} did not end within {seconds} s of the signal")

    def __enter__(self):
        return self

    def __exit__(self, kind, *_):
        if self.process.poll() is None:
            self.process.kill()
        self.process.wait()
        RUNNING.discard(self)
        if kind is not None:
            print("    the program's log:\n      " + "\n      ".join(self.log().splitlines()[-30:]))


def peer(role, *args, env=None, **params):
    given = [word for name, value in params.items() for word in ("-p", f"{name}:={value}")]
    return Program([PEER, "--ros-args", "-p", f"role:={role}", *given, *args], env)


def node(name, *args, env=None):
    return Program([os.path.join(BIN, "roscausal_ros2"), name, "--ros-args", *args], env)


def hang(name):
    """Ends all, with the place where each thread waits: a test that never returns cannot be ended alone."""
    print(f"FAILED  {name}: has not ended after {LONGEST} s. Its threads wait at:", flush=True)
    faulthandler.dump_traceback(sys.stdout)
    for program in RUNNING:
        print(f"    the log of {program.process.args}:\n      " + "\n      ".join(program.log().splitlines()[-30:]))
        program.process.kill()
    sys.stdout.flush()
    os._exit(1)


def main(pattern):
    passed, failed = 0, []
    for function in TESTS:
        if pattern and pattern not in function.__name__:
            continue
        started = time.monotonic()
        watchdog = threading.Timer(LONGEST, hang, [function.__name__])
        watchdog.start()
        try:
            note = function()
            passed += 1
            print(f"ok      {function.__name__} ({time.monotonic() - started:.1f} s){': ' + note if note else ''}")
        except Exception as error:  # whatever a test raises, it has failed, and the next one runs
            failed.append(function.__name__)
            traceback.print_exc(limit=-3, file=sys.stdout)
            print(f"FAILED  {function.__name__}: {error}")
        finally:
            watchdog.cancel()
        sys.stdout.flush()
    for name in failed:
        print(f"failed: {name}")
    print(f"{passed} passed, {len(failed)} failed")
    return 1 if failed or not passed else 0
