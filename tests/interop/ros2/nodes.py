"""Our nodes with rclpy at both ends: from a robot's and people's topics to states, batches and models; what they log
about missing or wrong input; signals, and a discovery node that is killed."""

import csv
import glob
import json
import math
import os
import random
import re
import signal
import sys
import tempfile
import time

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseArray, PoseStamped, PoseWithCovarianceStamped, Pose, TransformStamped
from nav_msgs.msg import Odometry
from rcl_interfaces.msg import Log, Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import DescribeParameters, GetParameters, SetParameters, SetParametersAtomically
from rclpy.parameter import Parameter as RclpyParameter
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import FluidPressure

sys.path.insert(0, os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
import switched_off
from harness import Ros, node, test
from held_thread import HeldThread, thread_of
from wire import LATCHED, RELIABLE, message_class

SENSOR = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)
NAMES = ("robot", "human", "data", "discovery")


def odometry(stamp, v=0.4):
    message = Odometry(child_frame_id="base_footprint")
    message.header.stamp, message.header.frame_id = stamp, "odom"
    message.pose.pose.orientation.w = 1.0
    message.twist.twist.linear.x, message.twist.twist.angular.z = v, 0.1
    return message


def pose(stamp, x=1.0, y=2.0, theta=0.5, frame="map"):
    message = PoseWithCovarianceStamped()
    message.header.stamp, message.header.frame_id = stamp, frame
    message.pose.pose.position.x, message.pose.pose.position.y = x, y
    message.pose.pose.orientation.z, message.pose.pose.orientation.w = math.sin(theta / 2), math.cos(theta / 2)
    return message


def people(stamp, *places):
    message = PoseArray()
    message.header.stamp, message.header.frame_id = stamp, "map"
    for x, y in places:
        place = Pose()
        place.position.x, place.position.y, place.orientation.w = x, y, 1.0
        message.poses.append(place)
    return message


class Sending:
    """Calls `tick(stamp)` at 20 Hz for as long as the node is spun within the `with` block."""

    def __init__(self, ros, tick):
        self.ros, self.tick = ros, tick

    def __enter__(self):
        self.timer = self.ros.node.create_timer(0.05, lambda: self.tick(self.ros.node.get_clock().now().to_msg()))

    def __exit__(self, *_):
        self.ros.node.destroy_timer(self.timer)


def heard(ros, kind, topic, qos=10):
    found = []
    ros.node.create_subscription(kind, topic, found.append, qos)
    return found


@test
def a_signal_of_a_type_that_only_a_msg_folder_knows_is_recorded_live():
    """rclpy has the type; our node reads it by the text in `msg_path`."""
    with tempfile.TemporaryDirectory() as folder, Ros() as ros:
        for package, name, text in (
            ("sensor_msgs", "FluidPressure", "std_msgs/Header header\nfloat64 fluid_pressure # Pascals\nfloat64 variance\n"),
            ("std_msgs", "Header", "builtin_interfaces/Time stamp\nstring frame_id\n"),
        ):
            texts = os.path.join(folder, "share", package, "msg")
            os.makedirs(texts)
            with open(os.path.join(texts, f"{name}.msg"), "w") as file:
                file.write(text)
        out = ros.node.create_publisher(FluidPressure, "/air", 10)

        def tick(stamp):
            message = FluidPressure(fluid_pressure=101325.0)
            message.header.stamp = stamp
            out.publish(message)

        given = ["data_dir:=" + folder, "pp_data_dir:=" + folder + "/pp", "ts_length:=2.0", "sel_agent:=nobody"]
        given += ["msg_path:=" + folder, "signals:=['bar = /air.fluid_pressure / 100000']"]
        words = [word for one in given for word in ("-p", one)]
        with node("data", *words, env={"AMENT_PREFIX_PATH": ""}), Sending(ros, tick):
            path = ros.until(lambda: glob.glob(folder + "/*.csv"), 20, "a batch")[0]
        with open(path, newline="") as file:
            values = [row["bar"] for row in csv.DictReader(file)]
    assert values.count("1.01325") >= len(values) - 3 and len(values) >= 15, values
    return f"{len(values)} rows"


@test
def the_robots_state_is_made_of_odometry_pose_and_goal():
    given = ["-p", "odom_topic:=/odom", "-p", "pose_topic:=/robot_pose", "-p", "goal_topic:=/goal_pose", "-p", "goal_type:=PoseStamped"]
    with node("robot", *given), Ros() as ros:
        # a sensor's profile: best effort
        odom = ros.node.create_publisher(Odometry, "/odom", SENSOR)
        poses = ros.node.create_publisher(PoseWithCovarianceStamped, "/robot_pose", 10)
        goals = ros.node.create_publisher(PoseStamped, "/goal_pose", 10)
        states, sent = heard(ros, message_class("roscausal_msgs/RobotState"), "/roscausal/robot"), []
        goal = PoseStamped()
        goal.header.frame_id, goal.pose.position.x, goal.pose.position.y = "map", 5.0, -6.0
        goal.pose.orientation.w = 1.0

        def tick(stamp):
            sent.append((stamp.sec, stamp.nanosec))
            odom.publish(odometry(stamp))
            poses.publish(pose(stamp))
            goals.publish(goal)

        with Sending(ros, tick):
            state = ros.until(lambda: next((m for m in states if m.goal.x == 5), None), 15, "a state with the goal")
            assert state.header.frame_id == "map" and (state.header.stamp.sec, state.header.stamp.nanosec) in sent
            assert abs(state.pose2d.x - 1) < 1e-6 and abs(state.pose2d.theta - 0.5) < 1e-6 and state.goal.y == -6
            assert state.twist.linear.x == 0.4 and state.twist.angular.z == 0.1
            count = len(states)
            ros.until(lambda: len(states) > count + 20, 10, "more states")


@test
def missing_topic_missing_tf_and_nan_are_said_and_the_node_lives():
    with node("robot", "-p", "odom_topic:=/o", "-p", "pose_topic:=/p") as program, Ros() as ros:
        odom = ros.node.create_publisher(Odometry, "/o", 10)
        poses = ros.node.create_publisher(PoseWithCovarianceStamped, "/p", 10)
        ros.node.create_publisher(PoseWithCovarianceStamped, "/amcl_pose", 10)
        profile = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        logs = heard(ros, Log, "/rosout", profile)
        diagnostics = heard(ros, DiagnosticArray, "/diagnostics")
        states = heard(ros, message_class("roscausal_msgs/RobotState"), "/roscausal/robot")

        def told(*words):
            what = f"a line with {words} on /rosout"
            ros.until(lambda: any(all(word in log.msg for word in words) for log in logs), 20, what)

        with Sending(ros, lambda stamp: odom.publish(odometry(stamp))):
            told("/p", "geometry_msgs/PoseWithCovarianceStamped", "/amcl_pose")
            status = ros.until(
                lambda: next((s for m in diagnostics for s in m.status if s.message.startswith("no messages")), None),
                5,
                "the reason on /diagnostics",
            )
            level = status.level if isinstance(status.level, int) else status.level[0]
            assert status.name == "roscausal_robot" and level == 1, status
        with Sending(ros, lambda stamp: (odom.publish(odometry(stamp)), poses.publish(pose(stamp, frame="nowhere")))):
            told("nowhere", "map")
        with Sending(ros, lambda stamp: (odom.publish(odometry(stamp, v=math.nan)), poses.publish(pose(stamp)))):
            told("linear.x is NaN")
        with Sending(ros, lambda stamp: (odom.publish(odometry(stamp, v=0.25)), poses.publish(pose(stamp)))):
            good = ros.until(lambda: next((m for m in states if m.twist.linear.x == 0.25), None), 10, "a good state")
            assert good.pose2d.x == 1
            ros.until(lambda: diagnostics[-1].status[0].message == "running", 10, "the trouble's end")
        assert program.process.poll() is None
        assert not any(math.isnan(m.twist.linear.x) for m in states), "NaN came out"


@test
def poses_in_another_frame_are_transformed():
    TFMessage = message_class("tf2_msgs/TFMessage")
    with node("robot", "-p", "odom_topic:=/o", "-p", "pose_topic:=/p"), Ros() as ros:
        transform = TransformStamped()
        transform.header.frame_id, transform.child_frame_id = "map", "hall"
        transform.transform.translation.x = 10.0
        transform.transform.rotation.z = transform.transform.rotation.w = math.sqrt(0.5)
        static = ros.node.create_publisher(TFMessage, "/tf_static", LATCHED)
        static.publish(TFMessage(transforms=[transform]))
        odom = ros.node.create_publisher(Odometry, "/o", 10)
        poses = ros.node.create_publisher(PoseWithCovarianceStamped, "/p", 10)
        states = heard(ros, message_class("roscausal_msgs/RobotState"), "/roscausal/robot")
        with Sending(ros, lambda stamp: (odom.publish(odometry(stamp)), poses.publish(pose(stamp, 1.0, 2.0, 0.0, "hall")))):
            ros.until(lambda: states, 15, "a state")
        assert abs(states[0].pose2d.x - 8) < 1e-6 and abs(states[0].pose2d.y - 1) < 1e-6, states[0]
        assert abs(states[0].pose2d.theta - math.pi / 2) < 1e-6


@test
def people_their_goal_parameter_and_an_empty_list():
    given = ["-p", "people_topic:=/faces", "-p", "people_type:=auto", "-p", "hri.human_goal:=[7.0, 8.0]"]
    with node("human", *given, "-p", "sel_agent:='0'") as program, Ros() as ros:
        faces = ros.node.create_publisher(PoseArray, "/faces", 10)
        humans = heard(ros, message_class("roscausal_msgs/Humans"), "/roscausal/humans")
        selected = heard(ros, message_class("roscausal_msgs/HumanState"), "/roscausal/human")
        places = [(3.0, 4.0), (-1.0, 0.5)]
        with Sending(ros, lambda stamp: faces.publish(people(stamp, *places))):
            ros.until(lambda: any(len(m.humans) == 2 for m in humans), 15, "two people")
            one = ros.until(lambda: next((m for m in selected if m.goal.x == 7), None), 10, "the goal of the start")
            assert one.id == 0 and one.pose2d.x == 3 and one.goal.y == 8, one
            value = ParameterValue(type=ParameterType.PARAMETER_DOUBLE_ARRAY, double_array_value=[-1.0, 2.0])
            request = SetParameters.Request(parameters=[Parameter(name="hri.human_goal", value=value)])
            results = ros.call(SetParameters, "/roscausal_human/set_parameters", request).results
            assert results[0].successful, results
            ros.until(lambda: any(m.goal.x == -1 and m.goal.y == 2 for m in selected), 10, "the goal set while running")
            places.clear()
            ros.spin(1.5)  # longer than an unseen person is kept
            humans.clear()
            ros.spin(0.5)
            assert not any(m.humans for m in humans), "people who are gone"
            places.append((9.0, 9.0))
            ros.until(lambda: any(m.pose2d.x == 9 for m in selected), 10, "the person again")
        assert program.process.poll() is None


@test
def every_sighting_of_a_jittering_tracker_counts_in_the_batch():
    places, seen = random.Random(1), []
    with tempfile.TemporaryDirectory() as folder, Ros() as ros:
        given = ["-p", "people_topic:=/faces", "-p", "sel_agent:='0'"]
        human = node("human", *given, "-p", "position_noise:=0.0")  # rows have its places as they are
        data = node("data", "-p", f"data_dir:={folder}/raw", "-p", f"pp_data_dir:={folder}/pp", "-p", "ts_length:=6.0", "-p", "sel_agent:='0'")
        with human, data, node("robot", "-p", "odom_topic:=/o", "-p", "pose_topic:=/p"):
            odom = ros.node.create_publisher(Odometry, "/o", 10)
            poses = ros.node.create_publisher(PoseWithCovarianceStamped, "/p", 10)
            faces = ros.node.create_publisher(PoseArray, "/faces", 10)

            def track():
                time.sleep(places.uniform(0, 0.02))
                stamp = ros.node.get_clock().now().to_msg()
                seen.append((stamp.sec + 1e-9 * stamp.nanosec, 3.0 + places.uniform(0, 0.3)))
                faces.publish(people(stamp, (seen[-1][1], 4.0)))

            timer = ros.node.create_timer(1 / 12, track)
            with Sending(ros, lambda stamp: (odom.publish(odometry(stamp)), poses.publish(pose(stamp)))):
                ros.until(lambda: glob.glob(f"{folder}/raw/data_*.csv"), 40, "a batch")
            ros.node.destroy_timer(timer)
        with open(sorted(glob.glob(f"{folder}/raw/data_*.csv"))[0]) as file:
            rows = [(float(row["time"]), float(row["h_0_x"] or "nan")) for row in csv.DictReader(file)]
    off = 0
    # In the first rows it is not known yet how often the tracker sees somebody.
    for t, x in rows[15:]:
        stamp, place = min(seen, key=lambda one: abs(one[0] - t))
        off += not abs(x - place) < 1e-4 if abs(stamp - t) < 0.0499 else x == x and abs(stamp - t) > 0.0501
    assert len(rows) == 60 and off == 0, f"{off} of {len(rows)} rows are not what the tracker said"
    return f"{len(seen)} sightings, {off} of {len(rows)} rows off"


@test
def a_nodes_parameter_out_of_range_is_refused_with_the_reason():
    with tempfile.TemporaryDirectory() as folder:
        with node("data", "-p", f"data_dir:={folder}/raw", "-p", f"pp_data_dir:={folder}/pp"), Ros() as ros:
            value = ParameterValue(type=ParameterType.PARAMETER_DOUBLE, double_value=-1.0)
            request = SetParameters.Request(parameters=[Parameter(name="dt", value=value)])
            result = ros.call(SetParameters, "/roscausal_data/set_parameters", request).results[0]
            assert not result.successful and re.search(r"dt.*-1.*0\.001.*60", result.reason), result.reason
            return result.reason


@test
def what_is_set_while_a_node_runs_is_refused_or_read_only_or_in_effect():
    with tempfile.TemporaryDirectory() as folder:
        pools = ["-p", f"data_dir:={folder}/raw", "-p", f"pp_data_dir:={folder}/pp"]
        watched = ["-p", f"data_dir:={folder}/pp", "-p", f"res_dir:={folder}/models", "-p", "cd_method:=pcmci", "-p", "cond_ind_test:=parcorr"]
        with node("data", *pools), node("discovery", *watched), Ros() as ros:
            # each: node, parameter, value, words of the reason (empty: it is set), read-only
            for name, parameter, value, words, read_only in [
                ("data", "ts_length", 10.0, "", False),
                ("data", "ts_length", 0.01, "at least dt", False),
                ("data", "features", ["h_v = speed("], "start the node again", True),
                ("data", "dt", 0.2, "start the node again with dt:=0.2", True),
                ("discovery", "cd_method", "nonsense", "'nonsense'", False),
                ("discovery", "max_lag", 3, "", False),
                ("discovery", "data_dir", folder, "start the node again", True),
            ]:
                before = of_node(ros, name, "get_parameters", GetParameters, names=[parameter]).values[0]
                result = of_node(ros, name, "set_parameters", SetParameters, parameters=[rclpy_parameter(parameter, value)]).results[0]
                assert result.successful == (not words) and words in result.reason and (not words or parameter in result.reason), result
                after = of_node(ros, name, "get_parameters", GetParameters, names=[parameter]).values[0]
                assert after == (before if words else rclpy_parameter(parameter, value).value), (parameter, after)
                described = of_node(ros, name, "describe_parameters", DescribeParameters, names=[parameter]).descriptors[0]
                assert described.read_only == read_only, (parameter, described)
            both = [rclpy_parameter("sig_alpha", 1e-6), rclpy_parameter("res_dir", "/elsewhere")]
            result = of_node(ros, "discovery", "set_parameters_atomically", SetParametersAtomically, parameters=both).result
            assert not result.successful and "res_dir" in result.reason, result
            level = of_node(ros, "discovery", "get_parameters", GetParameters, names=["sig_alpha"]).values[0]
            assert level.double_value == 0.05, "a refused transaction has changed something"
            # In effect: the next model has the new lag.
            a, lines = 0.0, ["time,a,b"]
            for row in range(200):
                b, a = 0.9 * a + 0.1 * math.sin(7.3 * row * row), math.sin(3.1 * row * row)
                lines.append(f"{row / 10},{a},{b}")
            with open(f"{folder}/batch.part", "w") as file:
                file.write("\n".join(lines) + "\n")
            os.rename(f"{folder}/batch.part", f"{folder}/pp/data_1.csv")
            model = f"{folder}/models/data_1.json"
            ros.until(lambda: os.path.exists(model), 30, "a model")
            with open(model) as file:
                assert json.load(file)["tau_max"] == 3


def of_node(ros, name, service, kind, **request):
    return ros.call(kind, f"/roscausal_{name}/{service}", kind.Request(**request))


def rclpy_parameter(name, value):
    return RclpyParameter(name, value=value).to_parameter_msg()


class Recording:
    """The data node, fed with states of a robot and a person that rclpy publishes at 20 Hz."""

    def __init__(self, ros, folder):
        State = message_class("roscausal_msgs/RobotState")
        Humans, Human = message_class("roscausal_msgs/Humans"), message_class("roscausal_msgs/HumanState")
        robot = ros.node.create_publisher(State, "/roscausal/robot", RELIABLE)
        humans = ros.node.create_publisher(Humans, "/roscausal/humans", RELIABLE)
        self.raw, self.pp = os.path.join(folder, "raw"), os.path.join(folder, "pp")
        self.program = node("data", "-p", f"data_dir:={self.raw}", "-p", f"pp_data_dir:={self.pp}", "-p", "ts_length:=0.0")

        def tick(stamp):
            t = time.monotonic()
            state, person, everybody = State(), Human(id=1000), Humans()
            for message in (state, person, everybody):
                message.header.stamp, message.header.frame_id = stamp, "map"
            state.pose2d.x, state.twist.linear.x = math.sin(t), 0.3
            person.pose2d.x, person.pose2d.y, person.twist.linear.x = math.cos(t), 4.0, 0.5
            everybody.humans = [person]
            robot.publish(state)
            humans.publish(everybody)

        self.sending = Sending(ros, tick)


@test
def unknown_parameters_are_named_with_the_nearest():
    with node("human", "-p", "target_fram:=map", "-p", "hri.goal:=[1.0, 2.0]", "-p", "goal_param:=/hri/goal") as program, Ros() as ros:
        ros.until(lambda: "there is no parameter 'target_fram'" in program.log(), 10, "the warning")
        # The parameter that goal_param names is read later.
        assert program.log().count("there is no parameter") == 1, program.log()


@test
def a_silent_clock_is_told_and_followed_when_it_runs():
    Clock = message_class("rosgraph_msgs/Clock")
    with node("robot", "-p", "use_sim_time:=true") as program, Ros() as ros:
        ros.until(lambda: "/clock has been silent for 5 s" in program.log(), 15, "the warning")
        clock, message = ros.node.create_publisher(Clock, "/clock", 10), Clock()
        ros.until(clock.get_subscription_count, 10, "the node at /clock")

        def tell(seconds, words):
            message.clock.sec = seconds
            ros.until(lambda: clock.publish(message) or words in program.log(), 10, words)

        tell(100, "/clock runs again, at 100.000 s")
        tell(7, "jumped back from 100.000 s to 7.000 s")


@test
def a_signal_flushes_the_batch_and_takes_the_node_out_of_the_graph_within_a_second():
    notes = []
    for number in (signal.SIGINT, signal.SIGTERM):
        with tempfile.TemporaryDirectory() as folder, Ros() as ros:
            recording = Recording(ros, folder)
            with recording.program as program, recording.sending:
                ros.until(lambda: "/roscausal_data" in ros.names(), 10, "the data node")
                ros.spin(4)
                assert not glob.glob(recording.raw + "/*.csv"), "a batch before its end"
                participants = ros.participants("roscausal_data")
                assert participants, "no topic of the data node"
                started = time.monotonic()
                program.send(number)
                ros.until(lambda: ros.gone("roscausal_data", participants), 5, "the leaving of the node and its topics")
                left = time.monotonic() - started
                assert program.wait() == 0
                assert left < 1, f"{left:.2f} s"
            (raw,) = glob.glob(recording.raw + "/*.csv")
            with open(raw) as file:
                rows = list(csv.DictReader(file))
            assert len(rows) >= 25 and {"time", "r_x", "h_1000_x"} <= set(rows[0]), (len(rows), list(rows[0]))
            with open(raw[:-3] + "json") as file:
                json.load(file)
            assert not glob.glob(recording.raw + "/*tmp*"), os.listdir(recording.raw)
            notes.append(f"{len(rows)} rows, gone after {left:.2f} s")
    return "; ".join(notes)


def batch(folder, name, seed):
    """A batch of post-processed variables in which h_v drives h_risk."""
    import random

    rng, v, risk = random.Random(seed), 0.0, 0.0
    path = os.path.join(folder, name)
    with open(path + ".tmp", "w") as file:
        file.write("time,h_v,h_dg,h_risk\n")
        for i in range(300):
            v, risk = 0.4 * v + rng.gauss(0, 1), 0.8 * v + rng.gauss(0, 0.5)
            file.write(f"{i / 10},{v},{rng.gauss(0, 1)},{risk}\n")
    os.rename(path + ".tmp", path)


@test
def a_killed_discovery_node_leaves_no_stale_model_and_is_found_again():
    Info = message_class("roscausal_msgs/CausalModelInfo")
    with tempfile.TemporaryDirectory() as folder:
        given = ["-p", f"data_dir:={folder}", "-p", "cond_ind_test:=parcorr", "-p", "cd_method:=pcmci"]

        def models(seconds, until_one):
            with Ros("late") as ros:
                infos = heard(ros, Info, "/roscausal/causal_model_info", LATCHED)
                if until_one:
                    ros.until(lambda: infos, seconds, "a model")
                ros.spin(1 if until_one else seconds)
                return [info.batch_id for info in infos]

        with node("discovery", *given) as program:
            batch(folder, "data_20240101_000000.csv", 1)
            assert models(15, True) == ["data_20240101_000000"]
            program.end(signal.SIGKILL)
        assert models(3, False) == []
        with node("discovery", *given):
            batch(folder, "data_20240101_000100.csv", 2)
            assert models(15, True) == ["data_20240101_000100"]


@test
def a_change_that_nobody_announced_is_told_to_who_comes_late():
    ModelChanges = message_class("roscausal_msgs/ModelChanges")
    with tempfile.TemporaryDirectory() as folder:
        switched_off.write(folder)
        given = {"data_dir": folder, "res_dir": folder + "/models", "cond_ind_test": "parcorr", "cd_method": "pcmci"}
        given["window_batches"] = 4
        with node("discovery", *[word for pair in given.items() for word in ("-p", "%s:=%s" % pair)]):
            end = time.monotonic() + 60
            while glob.glob(folder + "/*.csv"):
                assert time.monotonic() < end, os.listdir(folder)
                time.sleep(0.1)
            with Ros("late") as ros:
                told = heard(ros, ModelChanges, "/roscausal/model_changes", LATCHED)
                ros.until(lambda: told and switched_off.confirmed(told[-1]), 20, lambda: f"a change: {told}")
                return switched_off.check(told[-1])


@test
def a_node_whose_dds_library_hangs_is_started_anew_in_its_place():
    with tempfile.TemporaryDirectory() as folder, Ros() as ros:
        given = ["-p", f"data_dir:={folder}/raw", "-p", f"pp_data_dir:={folder}/pp", "-r", "__node:=kept"]
        with node("data", *given) as program:
            first = ros.until(lambda: ros.participants("kept"), 10, "the node")
            question = ros.until(lambda: thread_of(program.process.pid, "dds question"), 5, "the thread that asks")
            started = time.monotonic()
            with HeldThread(question) as held:
                ros.until(held.has_died, 20, "the end of the process's threads")
            ros.until(lambda: ros.participants("kept") - first, 10, "the node anew, under its own name")
            back = time.monotonic() - started
            assert "the DDS library hangs; the node is started anew" in program.log()
            assert program.end() == 0
    return f"{back:.1f} s"


@test
def idle_nodes_are_light():
    def ticks(pid):
        with open(f"/proc/{pid}/stat") as stat:
            fields = stat.read().rsplit(")", 1)[1].split()
        return int(fields[11]) + int(fields[12])

    with tempfile.TemporaryDirectory() as folder, Ros() as ros:
        dirs = {
            "data": ["-p", f"data_dir:={folder}/raw", "-p", f"pp_data_dir:={folder}/pp"],
            "discovery": ["-p", f"data_dir:={folder}/pp"],
        }
        programs = [node(name, *dirs.get(name, [])) for name in NAMES]
        try:
            ros.until(lambda: {f"/roscausal_{name}" for name in NAMES} <= set(ros.names()), 15, "all four nodes")
            ros.spin(2)
            before, seconds, notes = [ticks(p.process.pid) for p in programs], 8, []
            ros.spin(seconds)
            for name, program, start in zip(NAMES, programs, before):
                cpu = (ticks(program.process.pid) - start) / os.sysconf("SC_CLK_TCK") / seconds * 100
                with open(f"/proc/{program.process.pid}/status") as status:
                    memory = int(re.search(r"VmRSS:\s+(\d+)", status.read())[1]) / 1000
                notes.append(f"{name} {cpu:.1f} % of a core, {memory:.0f} MB")
                assert cpu < 2 and memory < 30, notes[-1]
        finally:
            for program in programs:
                program.end()
        return "; ".join(notes)
