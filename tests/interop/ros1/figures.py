"""Figures for docs/ros1.md, on an otherwise idle machine: messages at 1 kHz for a minute, what an idle node
costs, and the round-trip time of a message through this backend and through rospy. Asserts what is promised."""

import os
import statistics
import sys
import tempfile
import time

import genpy.dynamic
import rospy
from nav_msgs.msg import Odometry

sys.path.insert(0, os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
import known_system
from roscausal_msgs.msg import Features, Prediction

from harness import NODE, Group, Process, eventually, peer

group = Group()
case = group.case
SECONDS = float(os.environ.get("ROSCAUSAL_FIGURE_SECONDS", "60"))

RELAY = """
import rospy
from nav_msgs.msg import Odometry
rospy.init_node("relay")
out = rospy.Publisher("/back", Odometry, queue_size=100, tcp_nodelay=True)
rospy.Subscriber("/there", Odometry, out.publish, tcp_nodelay=True)
rospy.spin()
"""


def at_1_khz(publisher, seconds):
    """Publishes odometry. Returns the number of messages."""
    total, message, start = int(1000 * seconds), Odometry(), time.monotonic()
    message.header.frame_id, message.child_frame_id = "odom", "base_footprint"
    message.pose.pose.orientation.w = 1
    for index in range(total):
        pause = start + index / 1000 - time.monotonic()
        if pause > 0:
            time.sleep(pause)
        message.header.stamp = rospy.Time.now()
        publisher.publish(message)
    return total


@case
def a_minute_of_1_khz_loses_nothing(_):
    out = rospy.Publisher("/fast", Odometry, queue_size=10000, tcp_nodelay=True)
    with peer("count", "nav_msgs/Odometry", "/fast", "__name:=fast") as counter:
        eventually(out.get_num_connections, 10, counter.text)
        time.sleep(0.5)
        total = at_1_khz(out, SECONDS)
        counter.line("%d 0" % total, 5)
    out.unregister()
    return "%d of %d came" % (total, total)


@case
def the_robot_node_takes_a_minute_of_1_khz_odometry(_):
    got = []
    out = rospy.Publisher("/odom", Odometry, queue_size=10000, tcp_nodelay=True)
    diagnostics = rospy.Subscriber("/diagnostics", rospy.AnyMsg, got.append)
    with Process(NODE, "robot", "_odom_topic:=/odom") as robot:
        eventually(lambda: out.get_num_connections() and got, 10, robot.text)
        header = got[0]._connection_header
        kind = genpy.dynamic.generate_dynamic(header["type"], header["message_definition"])[header["type"]]
        time.sleep(0.5)
        before, start = used(robot.pid), time.monotonic()
        total = at_1_khz(out, SECONDS)
        cpu = (used(robot.pid) - before) / (time.monotonic() - start)
        time.sleep(2.5)
        values = {pair.key: pair.value for pair in kind().deserialize(got[-1]._buff).status[0].values}
        assert values["received /odom"] == str(total) and values["lost /odom"] == values["dropped"] == "0", values
    out.unregister()
    diagnostics.unregister()
    return "%d of %d came, %.1f %% of a core" % (total, total, 100 * cpu)


def used(pid):
    """Seconds of CPU time so far."""
    fields = open("/proc/%d/stat" % pid).read().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def memory(pid):
    return next(int(line.split()[1]) for line in open("/proc/%d/status" % pid) if line.startswith("VmRSS")) / 1000


def idle(name):
    def check(roscore):
        folder = tempfile.mkdtemp(dir=os.environ.get("ROSCAUSAL_WORK"), prefix="idle-")
        with Process(NODE, name, "_data_dir:=" + folder, "_pp_data_dir:=%s/pp" % folder) as node:
            eventually(lambda: "/roscausal_" + name in roscore.nodes(), 10, node.text)
            time.sleep(2)
            before, start = used(node.pid), time.monotonic()
            time.sleep(10)
            cpu, size = (used(node.pid) - before) / (time.monotonic() - start), memory(node.pid)
            assert cpu < 0.01 and size < 20, "%.2f %% of a core, %.1f MB" % (100 * cpu, size)
        return "%.2f %% of a core, %.1f MB" % (100 * cpu, size)
    check.__name__ = "the_idle_%s_node_costs_little" % name
    return check


for each in ("robot", "human", "data", "discovery"):
    case(idle(each))


@case
def an_idle_node_of_rospy(_):
    with Process("/usr/bin/python3", "-c", RELAY) as relay:
        time.sleep(3)
        before, start = used(relay.pid), time.monotonic()
        time.sleep(10)
        cpu = (used(relay.pid) - before) / (time.monotonic() - start)
        return "%.2f %% of a core, %.1f MB" % (100 * cpu, memory(relay.pid))


@case
def the_reasoning_node_at_3_rows_a_second(roscore):
    """With three Gaussian processes: each row gives a prediction, and every minute a fit."""
    names, step = list(known_system.NAMES), known_system.DT
    with tempfile.TemporaryDirectory() as folder:
        batch, graph, _ = known_system.write(folder)
        for name, value in {"data": [batch], "graph": graph, "equations": "gp"}.items():
            roscore.param("/roscausal_reasoning/" + name, value)
        got, rows = [], known_system.rows(20000, seed=2)
        predictions = rospy.Subscriber("/roscausal/prediction", Prediction, got.append)
        stream = rospy.Publisher("/roscausal/features", Features, queue_size=10)

        def publish(number):
            message = Features(names=names, values=rows[number])
            message.header.stamp = rospy.Time.from_sec(1000 + step * number)
            stream.publish(message)
            time.sleep(step)

        with Process(NODE, "reasoning") as node:
            eventually(stream.get_num_connections, 20, node.text)
            number = 0
            while not got:
                assert number < 300, node.text
                publish(number)
                number += 1
            seen, sent, before, start = len(got), number, used(node.pid), time.monotonic()
            while time.monotonic() - start < SECONDS:
                publish(number)
                number += 1
            cpu, size = (used(node.pid) - before) / (time.monotonic() - start), memory(node.pid)
        predictions.unregister()
        stream.unregister()
        assert len(got) - seen > 0.8 * (number - sent), (len(got) - seen, number - sent)
        assert cpu < 0.05 and size < 40, "%.2f %% of a core, %.1f MB" % (100 * cpu, size)
        return "%.2f %% of a core, %.1f MB" % (100 * cpu, size)


def there_and_back(process, pause):
    arrived, sent = [], {}
    out = rospy.Publisher("/there", Odometry, queue_size=1000, tcp_nodelay=True)
    back = rospy.Subscriber("/back", Odometry, lambda m: arrived.append((m.header.frame_id, time.perf_counter())),
                            tcp_nodelay=True)
    with process as relay:
        eventually(lambda: out.get_num_connections() and back.get_num_connections(), 20, lambda: relay.text)
        time.sleep(0.5)
        start = time.monotonic()
        for number in range(3000):
            # all of one length, as a robot's are: Linux then acknowledges late
            message = Odometry()
            message.header.frame_id = "%04d" % number
            sent[message.header.frame_id] = time.perf_counter()
            out.publish(message)
            time.sleep(max(0, start + (number + 1) * pause - time.monotonic()))
        time.sleep(0.5)
    out.unregister()
    back.unregister()
    return sorted(1e6 * (at - sent[name]) for name, at in arrived if name in sent)


def told(took):
    return "%d of 3000 came back; median %.0f us, 99 %% below %.0f us" % (
        len(took), statistics.median(took), took[int(len(took) * 0.99) - 1])


for rate in (100, 1000):
    def ours(_, rate=rate):
        took = there_and_back(peer("echo", "nav_msgs/Odometry", "/there", "/back"), 1 / rate)
        assert statistics.median(took) < 1000, told(took)
        return told(took)

    def rospys(_, rate=rate):
        return told(there_and_back(Process("/usr/bin/python3", "-c", RELAY), 1 / rate))
    ours.__name__, rospys.__name__ = "there_and_back_by_us_%d_Hz" % rate, "there_and_back_by_rospy_%d_Hz" % rate
    case(ours)
    case(rospys)


if __name__ == "__main__":
    sys.exit(group.run() > 0)
