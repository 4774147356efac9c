"""A node as part of the graph: arguments, parameters, clock, log, QoS, signals."""

import os
import re
import signal
import statistics
import subprocess
import sys
import tempfile
import time

from harness import PEER, Program, Ros, peer, test
from rcl_interfaces.msg import Log, Parameter, ParameterEvent, ParameterType, ParameterValue
from rcl_interfaces.srv import (
    DescribeParameters,
    GetParameters,
    GetParameterTypes,
    ListParameters,
    SetParameters,
    SetParametersAtomically,
)
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Bool, Header, String
from wire import LATCHED, RELIABLE, Echo, message_class

FILE = """/**:
  ros__parameters:
    a: 1
    c: 1e3
    nested: {x: 1.5, y: {z: "yes"}}
    li: [1, 2]
    bs: [true, false]
    t: true
peer:
  ros__parameters: {a: 2}
my:
  ns:
    bot:
      ros__parameters: {a: 7}
"""
# Command lines that rclpy and we must read in the same way; %f is the file above.
LINES = [
    "",
    "--ros-args -r __node:=bot",
    "--ros-args -r __ns:=/my/ns -r __node:=bot --params-file %f",
    "--ros-args --params-file %f -p a:=9 -p x.y:=hello -p z:=1.0",
    "--ros-args -p a:=1 -p a:=2 -p bot:a:=3 -p peer:a:=4",
    "--ros-args -r chat:=a -r chat:=b -r peer:/abs:=/zz -r other:/abs:=/yy",
    "--ros-args -r chat:=a -- --ros-args -r a/b/chat:=q -r rostopic://ns/chat:=w",
    "--ros-args -r __ns:=/my/ns -r /my/ns/chat:=~/bb -r /a/b/chat:=x/y -r ~/priv:=/p2",
    "--ros-args -r ns/chat:=~/c -r __name:=n2",
    "--ros-args -p l:=[1,2,3] -p s:='5' -p e:=\"\" -p b:=false -p d:=.5",
    "--ros-args -r __ns:=foo",
    "--ros-args -p e:=",
    "--ros-args -p e",
    "--ros-args -r a",
    "--ros-args --bogus",
    "--ros-args --params-file /no/such.yaml",
    "--ros-args -p l:=[1,2.5]",
    "--ros-args -r",
    "--ros-args --log-level loud",
]


def ours(line):
    run = subprocess.run([PEER, *line, "--ros-args", "-p", "role:=names"], capture_output=True, text=True, timeout=20)
    return None if run.returncode else sorted(l for l in run.stdout.splitlines() if not l.startswith("PARAM role"))


def theirs(line):
    run = subprocess.run([sys.executable, __file__, *line], capture_output=True, text=True, timeout=20)
    return None if run.returncode else sorted(run.stdout.splitlines())


@test
def command_lines_mean_what_they_mean_to_rclpy():
    with tempfile.NamedTemporaryFile("w", suffix=".yaml") as file:
        file.write(FILE)
        file.flush()
        for line in LINES:
            words = [word.replace("%f", file.name) for word in line.split()]
            # An open "--ros-args" ends at the next one, which ours() appends.
            rcl, own = theirs(words), ours(words)
            assert rcl == own, f"{line}: rclpy says {rcl}, we say {own}"
    return f"{len(LINES)} command lines"


@test
def namespaces_and_remaps_move_node_and_topics():
    with peer("echo", "-r", "__ns:=/lab", "-r", "__node:=echo1", "-r", "/in/std_msgs/String:=talk"), Ros() as ros:
        ros.until(lambda: "/lab/echo1" in ros.names(), 10, "node /lab/echo1")
        back = []
        publisher = ros.node.create_publisher(String, "/lab/talk", 10)
        ros.node.create_subscription(String, "/out/std_msgs/String", back.append, 10)
        ros.until(publisher.get_subscription_count, 10, "match of the remapped topic")

        def answered():
            publisher.publish(String(data="hello"))
            ros.spin(0.1)
            return back

        ros.until(answered, 5, "an answer")


@test
def parameters_are_listed_described_read_and_set_while_running():
    def integer(name, value):
        return Parameter(name=name, value=ParameterValue(type=ParameterType.PARAMETER_INTEGER, integer_value=value))

    with peer("model", count=0) as program, Ros() as ros:
        events = []
        ros.node.create_subscription(ParameterEvent, "/parameter_events", events.append, RELIABLE)
        names = ros.call(ListParameters, "/peer/list_parameters", ListParameters.Request()).result.names
        assert sorted(names) == ["count", "n_lags", "n_vars", "role", "use_sim_time"], names
        found = ros.call(GetParameters, "/peer/get_parameters", GetParameters.Request(names=["count", "no"])).values
        assert [value.type for value in found] == [2, 0] and found[0].integer_value == 0
        types = ros.call(GetParameterTypes, "/peer/get_parameter_types", GetParameterTypes.Request(names=["role"])).types
        assert list(types) == [ParameterType.PARAMETER_STRING]
        count, role = ros.call(
            DescribeParameters, "/peer/describe_parameters", DescribeParameters.Request(names=["count", "role"])
        ).descriptors
        assert count.description == "A whole number"
        assert (count.integer_range[0].from_value, count.integer_range[0].to_value) == (0, 1000000)
        assert "echo" in role.additional_constraints
        results = ros.call(
            SetParameters,
            "/peer/set_parameters",
            SetParameters.Request(parameters=[integer("count", 5), integer("count", -5), integer("coun", 5)]),
        ).results
        assert [result.successful for result in results] == [True, False, False], results
        assert "-5" in results[1].reason and "1000000" in results[1].reason, results[1].reason
        assert "did you mean 'count'" in results[2].reason, results[2].reason
        result = ros.call(
            SetParametersAtomically,
            "/peer/set_parameters_atomically",
            SetParametersAtomically.Request(parameters=[integer("count", 6), integer("n_vars", -1)]),
        ).result
        assert not result.successful
        value = ros.call(GetParameters, "/peer/get_parameters", GetParameters.Request(names=["count"])).values[0]
        assert value.integer_value == 5, "a refused transaction has changed something"
        ros.until(lambda: any(p.name == "count" for e in events for p in e.changed_parameters), 5, "/parameter_events")
        assert all(event.node == "/peer" for event in events if any(p.name == "count" for p in event.changed_parameters))
        assert "refused" in program.log()


@test
def simulated_time_comes_from_clock():
    RobotState = message_class("roscausal_msgs/RobotState")
    with peer("count", count=100000, use_sim_time="true"), Ros() as ros:
        clock = ros.node.create_publisher(Clock, "/clock", 10)
        ros.until(clock.get_subscription_count, 10, "the node at /clock")
        stamps = []
        message = Clock()
        message.clock.sec, message.clock.nanosec = 123, 500000000
        ros.node.create_timer(0.02, lambda: clock.publish(message))
        ros.node.create_subscription(RobotState, "/state", lambda m: stamps.append(m.header.stamp), RELIABLE)
        ros.until(lambda: stamps and (stamps[-1].sec, stamps[-1].nanosec) == (123, 500000000), 10, "stamp 123.5")


@test
def log_messages_reach_rosout():
    with peer("model", count=1), Ros() as ros:
        logs = []
        profile = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL, reliability=ReliabilityPolicy.RELIABLE)
        ros.node.create_subscription(Log, "/rosout", logs.append, profile)
        ros.until(lambda: any("1 models sent" in log.msg for log in logs), 10, "the line in /rosout")
        log = next(log for log in logs if "1 models sent" in log.msg)
        assert int.from_bytes(log.level, "little") if isinstance(log.level, bytes) else log.level == 20
        assert log.name == "peer" and log.stamp.sec > 0


@test
def incompatible_qos_and_wrong_types_are_said_with_both_sides():
    with peer("echo") as program, Ros() as ros, Ros("other") as other:
        ros.node.create_subscription(String, "/out/std_msgs/String", lambda _: None, LATCHED)
        ros.node.create_publisher(String, "/in/nav_msgs/Odometry", 10)
        ros.until(lambda: "transient_local" in program.log(), 10, "the QoS warning")
        assert re.search(r"'/out/std_msgs/String'.*reliable volatile.*reliable transient_local", program.log())
        ros.until(lambda: "another node uses it for std_msgs/String" in program.log(), 10, "the type warning")
        assert "nav_msgs/Odometry" in program.log()
        # A reliable subscriber of another type acknowledges nothing. It must not hold up the one of the right type.
        other.node.create_subscription(Bool, "/out/std_msgs/Header", lambda _: None, RELIABLE)
        ros.until(lambda: "std_msgs/Bool" in program.log(), 10, "the type warning")
        echo = Echo(ros, "std_msgs/Header")
        ros.until(echo.matched, 10, "match")
        for number in range(300):
            assert echo.round_trip(Header(frame_id=str(number))).frame_id == str(number)


@test
def wrong_starts_end_with_code_2_and_one_sentence():
    with tempfile.NamedTemporaryFile("w", suffix=".yaml") as file:
        file.write("peer:\n  ros__parameters:\n    a: [1, 2\n")
        file.flush()
        binary = os.path.join(os.environ["ROSCAUSAL_BIN"], "roscausal_ros2")
        for args, words in (
            (["robot", "--ros-args", "--bogus"], ["--bogus"]),
            (["robot", "--ros-args", "--params-file", "/no/such.yaml"], ["/no/such.yaml"]),
            (["robot", "--ros-args", "--params-file", file.name], [file.name, "line 4"]),
            (["robt"], ["robt", "usage"]),
            (["data", "--ros-args", "-p", "dt:=-1"], ["dt", "-1"]),
        ):
            run = subprocess.run([binary, *args], capture_output=True, text=True, timeout=20)
            assert run.returncode == 2, f"{args}: code {run.returncode}, {run.stderr}"
            assert all(word in run.stderr for word in words), f"{args}: {run.stderr}"
            assert "panicked" not in run.stderr and len(run.stderr.strip().splitlines()) <= 2, run.stderr


@test
def signals_take_the_node_out_of_the_graph_within_a_second():
    times = []
    for number in (signal.SIGINT, signal.SIGTERM):
        with peer("echo") as program, Ros() as ros:
            ros.until(lambda: "/peer" in ros.names(), 10, "the node")
            started = time.monotonic()
            program.send(number)
            ros.until(lambda: "/peer" not in ros.names(), 3, "the node's leaving")
            times.append(time.monotonic() - started)
            assert program.wait() == 0
    assert max(times) < 1, times
    return ", ".join(f"{seconds:.2f} s" for seconds in times)


@test
def a_killed_node_is_found_again_when_it_comes_back():
    with Ros() as ros:
        echo = Echo(ros, "std_msgs/String")
        with peer("echo") as program:
            ros.until(echo.matched, 10, "match")
            echo.round_trip(String(data="one"))
            program.end(signal.SIGKILL)
        with peer("echo"):
            assert echo.round_trip(String(data="two"), 15).data == "two"


@test
def discovery_is_quick():
    times = []
    with Ros() as ros:
        for _ in range(int(os.environ.get("ROSCAUSAL_STARTS", "20"))):
            ros.until(lambda: "/peer" not in ros.names(), 10, "the last one's leaving")
            started = time.monotonic()
            with peer("model", count=0) as program:
                ros.until(lambda: "/peer" in ros.names(), 10, "the node")
                times.append(time.monotonic() - started)
                program.end()
    median = statistics.median(times)
    assert median < 2, times
    return f"median {median:.2f} s from start to being listed, {len(times)} starts, longest {max(times):.2f} s"


if __name__ == "__main__":  # what rclpy makes of this command line
    import rclpy

    rclpy.init(args=sys.argv)
    probe = rclpy.create_node("peer", automatically_declare_parameters_from_overrides=True)
    print("NAME", probe.get_fully_qualified_name())
    for topic in ("chat", "/abs", "~/priv", "ns/chat", "/a/b/chat"):
        print("TOPIC", topic, probe.resolve_topic_name(topic))

    def spelled(value):
        if isinstance(value, bool):
            return f"Bool({str(value).lower()})"
        if isinstance(value, int):
            return f"Int({value})"
        if isinstance(value, float):
            return f"Double({value})"
        if isinstance(value, str):
            return f'Str("{value}")'
        return "List([" + ", ".join(spelled(item) for item in value) + "])"

    for name, parameter in probe._parameters.items():
        if name not in ("use_sim_time", "start_type_description_service"):
            print("PARAM", name, spelled(parameter.value if not hasattr(parameter.value, "tolist") else parameter.value.tolist()))
