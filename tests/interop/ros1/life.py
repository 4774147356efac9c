"""Joining and leaving: waiting for a master, and no dead entry on it after signals, rosnode kill and panics."""

import os
import signal
import socket
import subprocess
import sys
import time

from harness import Group, Process, eventually, free_port, peer

group = Group()
case = group.case


def gone(roscore, node, timeout=5):
    eventually(lambda: node not in roscore.nodes(), timeout, lambda: "%s still in %s" % (node, roscore.nodes()))
    listed = subprocess.run(["rosnode", "list"], capture_output=True, text=True, timeout=30).stdout
    assert node not in listed.split(), listed


def there(roscore, node, timeout=10):
    eventually(lambda: node in roscore.nodes(), timeout, lambda: "%s not in %s" % (node, roscore.nodes()))


@case
def the_command_line_tools_know_the_node(roscore):
    def tool(*command):
        done = subprocess.run(command, capture_output=True, text=True, timeout=30)
        return done.stdout + done.stderr
    with peer("latch", "/told", "hello", "__name:=known"):
        there(roscore, "/known")
        eventually(lambda: "/told" in dict(roscore.master.getPublishedTopics("/t", "")[2]), 10, "the topic")
        for command, part in (
                (("rosnode", "list"), "/known"), (("rosnode", "ping", "-c", "1", "/known"), "xmlrpc reply from"),
                (("rostopic", "type", "/told"), "std_msgs/String"), (("rostopic", "info", "/told"), "* /known (http://"),
                (("rostopic", "echo", "-n", "1", "/told"), 'data: "hello"'), (("rosnode", "info", "/known"), "/rosout")):
            out = tool(*command)
            assert part in out, "%s: %s" % (" ".join(command), out)


def leaves_after(number):
    def check(roscore):
        with peer("latch", "/t", "x", "__name:=mortal") as mortal:
            there(roscore, "/mortal")
            mortal.send(number)
            assert mortal.ended() == 0, mortal.text
            gone(roscore, "/mortal", 0.5)
    check.__name__ = "no_ghost_after_" + signal.Signals(number).name
    return check


case(leaves_after(signal.SIGINT))
case(leaves_after(signal.SIGTERM))


@case
def no_ghost_after_rosnode_kill(roscore):
    with peer("latch", "/t", "x", "__name:=killed") as killed:
        there(roscore, "/killed")
        subprocess.run(["rosnode", "kill", "/killed"], capture_output=True, timeout=30, check=True)
        assert killed.ended() == 0, killed.text
        gone(roscore, "/killed", 0.5)


@case
def no_ghost_after_a_panic(roscore):
    with peer("crash", "__name:=crasher") as crasher:
        there(roscore, "/crasher")
        assert crasher.ended() != 0
        gone(roscore, "/crasher", 0.5)


@case
def a_second_node_of_the_name_ends_the_first(roscore):
    with peer("latch", "/t", "first", "__name:=twin") as first:
        there(roscore, "/twin")
        with peer("latch", "/t", "second", "__name:=twin") as second:
            first.ended()
            time.sleep(1.5)  # the watchdog of the second must not give in
            assert second.child.poll() is None, second.text
            there(roscore, "/twin")


@case
def without_master_it_waits_says_so_and_starts_with_it(_):
    port = free_port()
    env = {"ROS_MASTER_URI": "http://127.0.0.1:%d/" % port}
    with peer("latch", "/t", "x", "__name:=patient", env=env) as patient:
        line = patient.line("waiting for the ROS master")
        assert str(port) in line and "roscore" in line, line
        with Process("/usr/bin/roscore", "-p", port, env=env):
            import xmlrpc.client
            master = xmlrpc.client.ServerProxy(env["ROS_MASTER_URI"])

            def registered():
                try:
                    return master.lookupNode("/tests", "/patient")[0] == 1
                except OSError:
                    return False
            eventually(registered, 20, lambda: patient.text)


@case
def a_signal_ends_the_wait_for_a_master(_):
    env = {"ROS_MASTER_URI": "http://127.0.0.1:%d/" % free_port()}
    with peer("latch", "/t", "x", env=env) as patient:
        patient.line("waiting for the ROS master")
        patient.send(signal.SIGINT)
        patient.ended(3)


@case
def a_master_that_accepts_and_says_nothing_is_told_and_a_signal_ends_the_wait(_):
    with socket.socket() as silent:
        silent.bind(("127.0.0.1", 0))
        silent.listen(20)
        env = {"ROS_MASTER_URI": "http://127.0.0.1:%d/" % silent.getsockname()[1]}
        with peer("latch", "/t", "x", env=env) as patient:
            patient.line("waiting for the ROS master")
            patient.line("no answer within 2.0 s")
            patient.send(signal.SIGTERM)
            patient.ended(4)


@case
def a_hanging_master_holds_nobody_up(roscore):
    listed = subprocess.run(["pgrep", "-P", str(roscore.process.pid)], capture_output=True, text=True).stdout.split()
    master = next(int(pid) for pid in listed if "rosmaster" in open("/proc/%s/cmdline" % pid).read())
    with peer("latch", "/held_topic", "x", "__name:=held") as held:
        eventually(lambda: "/held_topic" in dict(roscore.master.getPublishedTopics("/tests", "")[2]), 10, "the topic")
        os.kill(master, signal.SIGSTOP)
        try:
            held.line("lost the ROS master", 15)
            start = time.monotonic()
            held.send(signal.SIGTERM)
            held.ended(12)
            took = time.monotonic() - start
        finally:
            os.kill(master, signal.SIGCONT)
    return "ended in %.1f s" % took


@case
def idle_costs_little(roscore):
    with peer("latch", "/t", "x", "__name:=idle") as idle:
        there(roscore, "/idle")
        time.sleep(1)
        ticks = os.sysconf("SC_CLK_TCK")

        def used():
            fields = open("/proc/%d/stat" % idle.pid).read().rsplit(")", 1)[1].split()
            return (int(fields[11]) + int(fields[12])) / ticks
        before, start = used(), time.monotonic()
        time.sleep(6)
        share = (used() - before) / (time.monotonic() - start)
        rss = next(int(line.split()[1]) for line in open("/proc/%d/status" % idle.pid) if line.startswith("VmRSS"))
        assert rss < 20_000, "%d kB" % rss
        assert share < 0.02, "%.1f %% of a core" % (100 * share)
    return "%.1f %% of a core, %.1f MB" % (100 * share, rss / 1000)


if __name__ == "__main__":
    sys.exit(group.run(node=False) > 0)
