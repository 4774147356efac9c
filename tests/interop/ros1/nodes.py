"""The nodes with rospy at both ends: from a robot's and people's topics to states and batches; bags, signals, a
restarted master."""

import csv
import glob
import math
import os
import random
import signal
import subprocess
import sys
import tempfile
import threading
import time

import genpy.dynamic
import rospy
import tf2_ros
from geometry_msgs.msg import PoseWithCovarianceStamped, TransformStamped, TwistStamped
from move_base_msgs.msg import MoveBaseActionGoal
from nav_msgs.msg import Odometry
from pedsim_msgs.msg import AgentState, AgentStates, TrackedPerson, TrackedPersons
from roscausal_msgs.msg import Humans, HumanState, ModelChanges, RobotState
from rosgraph_msgs.msg import Log
from visualization_msgs.msg import Marker, MarkerArray

sys.path.insert(0, os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
import switched_off
from harness import NODE, Group, Process, eventually

group = Group()
case = group.case


class Publishing:
    """Calls `tick(stamp)` at a rate, in a thread, until the end of the `with` block."""

    def __init__(self, rate, tick):
        self.rate, self.tick, self.stop = rate, tick, threading.Event()
        self.thread = threading.Thread(target=self.run, daemon=True)

    def run(self):
        next_one = time.monotonic()
        while not self.stop.is_set():
            self.tick(rospy.Time.now())
            next_one += 1.0 / self.rate
            time.sleep(max(0, next_one - time.monotonic()))

    def __enter__(self):
        self.thread.start()
        return self

    def __exit__(self, *_):
        self.stop.set()
        self.thread.join(5)


def node(name, *args):
    return Process(NODE, name, *args)


def odometry(stamp, v=0.4, omega=0.1):
    message = Odometry(child_frame_id="base_footprint")
    message.header.stamp, message.header.frame_id = stamp, "odom"
    message.pose.pose.orientation.w = 1
    message.twist.twist.linear.x, message.twist.twist.angular.z = v, omega
    return message


def pose(stamp, x=1.0, y=2.0, theta=0.5, frame="map"):
    message = PoseWithCovarianceStamped()
    message.header.stamp, message.header.frame_id = stamp, frame
    message.pose.pose.position.x, message.pose.pose.position.y = x, y
    message.pose.pose.orientation.z, message.pose.pose.orientation.w = math.sin(theta / 2), math.cos(theta / 2)
    return message


def person(stamp, people=((1000, 3.0, 4.0, 0.3),)):
    message = TrackedPersons()
    message.header.stamp, message.header.frame_id = stamp, "map"
    for number, x, y, v in people:
        track = TrackedPerson(track_id=number)
        track.pose.pose.position.x, track.pose.pose.position.y, track.pose.pose.orientation.w = x, y, 1
        track.twist.twist.linear.x = v
        message.tracks.append(track)
    return message


class Collect:
    def __init__(self, topic, kind):
        self.all = []
        self.subscriber = rospy.Subscriber(topic, kind, self.all.append)

    def one(self, check=lambda _: True, timeout=15, what="a message"):
        return eventually(lambda: next((m for m in list(self.all) if check(m)), None), timeout,
                          lambda: "%s on %s; %d came, the last: %s" % (
                              what, self.subscriber.name, len(self.all), self.all[-1:]))


@case
def the_robots_state_is_made_of_odometry_pose_and_goal(_):
    out = [rospy.Publisher("/mobile_base_controller/odom", Odometry, queue_size=10),
           rospy.Publisher("/robot_pose", PoseWithCovarianceStamped, queue_size=10)]
    goals = rospy.Publisher("/move_base/goal", MoveBaseActionGoal, queue_size=1, latch=True)
    goal = MoveBaseActionGoal()
    goal.goal.target_pose.header.frame_id = "map"
    goal.goal.target_pose.pose.position.x, goal.goal.target_pose.pose.position.y = 5, -6
    goal.goal.target_pose.pose.orientation.w = 1
    goals.publish(goal)
    states = Collect("/roscausal/robot", RobotState)
    sent = []

    def tick(stamp):
        sent.append(stamp)
        out[0].publish(odometry(stamp))
        out[1].publish(pose(stamp))
    with node("robot") as robot, Publishing(20, tick):
        state = states.one(lambda m: m.goal.x == 5, what="a state with goal\n" + robot.text)
        assert state.header.frame_id == "map" and state.header.stamp in sent, state
        assert abs(state.pose2D.x - 1) < 1e-6 and abs(state.pose2D.y - 2) < 1e-6, state
        assert abs(state.pose2D.theta - 0.5) < 1e-6 and state.goal.y == -6, state
        assert state.twist.linear.x == 0.4 and state.twist.angular.z == 0.1, state
        count = len(states.all)
        eventually(lambda: len(states.all) > count + 20, 10, "more states")
    for publisher in out + [goals]:
        publisher.unregister()


@case
def missing_input_missing_tf_and_nan_are_told_and_the_node_lives(_):
    lines = []
    rospy.Subscriber("/rosout", Log, lambda log: lines.append((log.name, log.msg)))
    odom = rospy.Publisher("/o", Odometry, queue_size=10)
    poses = rospy.Publisher("/p", PoseWithCovarianceStamped, queue_size=10)
    states = Collect("/roscausal/robot", RobotState)

    def told(*parts):
        eventually(lambda: any(all(p in text for p in parts) for _, text in list(lines)), 20,
                   lambda: "a line with %s on /rosout; there are %s\n%s" % (parts, lines, robot.text))
    with node("robot", "_odom_topic:=/o", "_pose_topic:=/p") as robot:
        with Publishing(20, lambda stamp: odom.publish(odometry(stamp))):
            told("/p", "geometry_msgs/PoseWithCovarianceStamped")
        with Publishing(20, lambda stamp: (odom.publish(odometry(stamp)), poses.publish(pose(stamp, frame="nowhere")))):
            told("nowhere", "map")
        with Publishing(20, lambda stamp: (odom.publish(odometry(stamp, v=math.nan)), poses.publish(pose(stamp)))):
            told("linear.x is NaN")
        before = len(states.all)
        with Publishing(20, lambda stamp: (odom.publish(odometry(stamp, v=0.25)), poses.publish(pose(stamp)))):
            good = states.one(lambda m: m.twist.linear.x == 0.25, what="a good state after %d\n%s" % (before, robot.text))
            assert good.pose2D.x == 1
        assert robot.child.poll() is None
        assert not any(math.isnan(m.twist.linear.x) or math.isnan(m.pose2D.x) for m in states.all), "NaN came out"
    odom.unregister()
    poses.unregister()


@case
def poses_in_another_frame_are_transformed(_):
    broadcaster = tf2_ros.StaticTransformBroadcaster()
    transform = TransformStamped()
    transform.header.stamp, transform.header.frame_id, transform.child_frame_id = rospy.Time.now(), "map", "hall"
    transform.transform.translation.x = 10
    transform.transform.rotation.z = transform.transform.rotation.w = math.sqrt(0.5)
    broadcaster.sendTransform(transform)
    odom = rospy.Publisher("/o", Odometry, queue_size=10)
    poses = rospy.Publisher("/p", PoseWithCovarianceStamped, queue_size=10)
    states = Collect("/roscausal/robot", RobotState)
    with node("robot", "_odom_topic:=/o", "_pose_topic:=/p") as robot, Publishing(
            20, lambda stamp: (odom.publish(odometry(stamp)), poses.publish(pose(stamp, 1, 2, 0, "hall")))):
        state = states.one(what="a state\n" + robot.text)
        assert abs(state.pose2D.x - 8) < 1e-6 and abs(state.pose2D.y - 1) < 1e-6, state
        assert abs(state.pose2D.theta - math.pi / 2) < 1e-6, state
    odom.unregister()
    poses.unregister()


@case
def people_their_goal_parameter_and_an_empty_list(roscore):
    roscore.param("/hri/human_goal", [7.0, 8.0])
    out = rospy.Publisher("/ped/control/teleop_persons", TrackedPersons, queue_size=10)
    everybody, selected = Collect("/roscausal/humans", Humans), Collect("/roscausal/human", HumanState)
    people = [(1000, 3.0, 4.0, 0.3), (7, -1.0, 0.5, 1.0)]
    with node("human") as human, Publishing(20, lambda stamp: out.publish(person(stamp, people))):
        humans = everybody.one(lambda m: len(m.humans) == 2, what="two people\n" + human.text)
        assert humans.header.frame_id == "map" and sorted(h.id for h in humans.humans) == [7, 1000], humans
        one = selected.one(lambda m: m.goal.x == 7)
        assert one.id == 1000 and one.goal.y == 8 and one.pose2D.x == 3 and one.pose2D.y == 4, one
        assert abs(one.twist.linear.x - 0.3) < 1e-9, one
        roscore.param("/hri/human_goal", [-1, 2])  # whole numbers, while it runs
        selected.one(lambda m: m.goal.x == -1 and m.goal.y == 2, what="the new goal\n" + human.text)
        people.clear()
        time.sleep(1.5)  # longer than an unseen person is kept
        everybody.all.clear()
        time.sleep(0.5)
        assert not any(m.humans for m in everybody.all), "people who are gone: %s" % everybody.all[-1]
        people.append((1000, 9.0, 9.0, 0.1))
        selected.one(lambda m: m.pose2D.x == 9, what="the person again")
        assert human.child.poll() is None
    out.unregister()


@case
def pedsims_own_people_are_taken_in_their_frame_by_dynamic_tf(_):
    broadcaster = tf2_ros.TransformBroadcaster()
    out = rospy.Publisher("/pedsim_simulator/simulated_agents", AgentStates, queue_size=10)
    everybody = Collect("/roscausal/humans", Humans)

    def tick(stamp):
        transform = TransformStamped()
        transform.header.stamp, transform.header.frame_id, transform.child_frame_id = stamp, "map", "walking_hall"
        transform.transform.translation.y, transform.transform.rotation.w = 100, 1
        broadcaster.sendTransform(transform)
        agents = AgentStates()
        agents.header.stamp, agents.header.frame_id = stamp, "walking_hall"
        for number in (3, 5):
            agent = AgentState(id=number)
            agent.header = agents.header
            agent.pose.position.x, agent.pose.position.y, agent.pose.orientation.w = number, 1, 1
            agent.twist.linear.y = 0.5
            agents.agent_states.append(agent)
        out.publish(agents)
    with node("human") as human, Publishing(20, tick):
        humans = everybody.one(lambda m: len(m.humans) == 2, what="two agents\n" + human.text).humans
        assert [(h.id, h.pose2D.x, h.pose2D.y) for h in humans] == [(3, 3, 101), (5, 5, 101)], humans
        assert all(abs(math.hypot(h.twist.linear.x, h.twist.linear.y) - 0.5) < 1e-9 for h in humans), humans
    out.unregister()


@case
def people_of_a_type_that_is_found_by_itself_are_taken(_):
    out = rospy.Publisher("/tracks", MarkerArray, queue_size=10)
    everybody = Collect("/roscausal/humans", Humans)

    def tick(stamp):
        array = MarkerArray()
        for number, (ns, x) in enumerate((("people", 3.0), ("walls", 4.0), ("people", 5.0))):
            marker = Marker(ns=ns, id=number)
            marker.header.stamp, marker.header.frame_id = stamp, "map"
            marker.pose.position.x, marker.pose.orientation.w = x, 1
            array.markers.append(marker)
        out.publish(array)
    with node("human", "_people_topic:=/tracks") as human, Publishing(20, tick):
        humans = everybody.one(lambda m: len(m.humans) == 2, what="two markers\n" + human.text).humans
        assert [(h.id, h.pose2D.x) for h in humans] == [(0, 3), (2, 5)], humans
    out.unregister()


@case
def signals_of_any_topic_are_recorded_live(_):
    out = rospy.Publisher("/speed", TwistStamped, queue_size=10)

    def tick(stamp):
        message = TwistStamped()
        message.header.stamp, message.twist.linear.x = stamp, 0.25
        out.publish(message)
    folder = tempfile.mkdtemp(dir=os.environ.get("ROSCAUSAL_WORK"), prefix="signals-")
    given = ["_data_dir:=" + folder, "_pp_data_dir:=%s/pp" % folder, "_ts_length:=2", "_sel_agent:=nobody"]
    with node("data", *given, "_signals:=[v = 2 * /speed.twist.linear.x]") as data, Publishing(20, tick):
        path = eventually(lambda: glob.glob(folder + "/data_*.csv"), 20, lambda: "a batch\n" + data.text)[0]
    with open(path, newline="") as file:
        values = [row["v"] for row in csv.DictReader(file)]
    assert values.count("0.5") >= len(values) - 3 and len(values) >= 15, values
    out.unregister()
    return "%d rows" % len(values)


class Recording:
    """States of a robot and a person as rospy publishes them, 50 Hz, and the data node with a folder of its own."""

    def __init__(self, *args):
        self.dir = tempfile.mkdtemp(dir=os.environ.get("ROSCAUSAL_WORK"), prefix="pool-")
        self.robot = rospy.Publisher("/roscausal/robot", RobotState, queue_size=100)
        self.humans = rospy.Publisher("/roscausal/humans", Humans, queue_size=100)
        self.node = node("data", "_data_dir:=" + self.dir, "_pp_data_dir:=%s/pp" % self.dir, *args)
        self.publishing = Publishing(50, self.tick)

    def tick(self, stamp):
        robot = RobotState()
        robot.header.stamp, robot.header.frame_id = stamp, "map"
        robot.pose2D.x, robot.twist.linear.x = stamp.to_sec() % 1000, 0.5
        robot.goal.x = 3
        one = HumanState(id=1000)
        one.header = robot.header
        one.pose2D.x, one.pose2D.y, one.twist.linear.x, one.goal.y = -(stamp.to_sec() % 1000), 1, 1.25, 4
        self.robot.publish(robot)
        self.humans.publish(Humans(header=robot.header, humans=[one]))

    def __enter__(self):
        self.publishing.__enter__()
        eventually(lambda: self.robot.get_num_connections() and self.humans.get_num_connections(), 15,
                   lambda: "the data node\n" + self.node.text)
        return self

    def __exit__(self, *_):
        self.node.__exit__()
        self.publishing.__exit__()
        self.robot.unregister()
        self.humans.unregister()

    def batch(self, timeout=20):
        path = eventually(lambda: glob.glob(self.dir + "/data_*.csv"), timeout,
                          lambda: "a batch in %s\n%s" % (os.listdir(self.dir), self.node.text))[0]
        with open(path, newline="") as file:
            return list(csv.DictReader(file))


def check_rows(rows, fewest, flushed=False):
    """`flushed`: at the end, one of two simultaneous messages may not have arrived, so the last row may lack it."""
    assert len(rows) >= fewest, "%d rows" % len(rows)
    if flushed and "" in rows[-1].values():
        rows = rows[:-1]
    times = [float(row["time"]) for row in rows]
    steps = [b - a for a, b in zip(times, times[1:])]
    assert all(abs(step - 0.1) < 1e-6 for step in steps), steps
    for row in rows:
        assert all(math.isfinite(float(value)) for value in row.values() if value is not None and value != ""), row
        assert "" not in row.values(), row
        assert abs(float(row["r_v"]) - 0.5) < 1e-9 and abs(float(row["h_1000_v"]) - 1.25) < 1e-9, row
        # A sample at most a quarter of a step away may be the row (docs/data.md), where one topic came late and the other did not.
        assert abs(float(row["r_x"]) + float(row["h_1000_x"])) < 0.026, row


@case
def a_batch_of_rospys_states_is_written(_):
    with Recording("_ts_length:=3") as recording:
        rows = recording.batch()
        check_rows(rows, 29)
    return "%d rows" % len(rows)


def flushed_after(what, end):
    def check(roscore):
        with Recording('_ts_length:=1000') as recording:
            time.sleep(2)
            end(recording.node)
            assert recording.node.ended() == 0, recording.node.text
            assert "/roscausal_data" not in roscore.nodes(), "a ghost"
            rows = recording.batch(1)
            check_rows(rows, 15, flushed=True)
        return "%d rows" % len(rows)
    check.__name__ = "the_open_batch_is_flushed_after_" + what
    return check


case(flushed_after("SIGINT", lambda node: node.send(signal.SIGINT)))
case(flushed_after("SIGTERM", lambda node: node.send(signal.SIGTERM)))
case(flushed_after("rosnode_kill", lambda _: subprocess.run(
    ["rosnode", "kill", "/roscausal_data"], capture_output=True, timeout=30, check=True)))


@case
def the_original_spellings_of_parameters_are_taken(roscore):
    for name, value in {"ts_length": "2", "subsampling": "False", "dt": "0.1", "delete_traj": "False", "sel_agent": "1000",
                        "obs_size": 2, "safe_dist": "5.0", "pp_script": "", "pp_script_dir": ""}.items():
        roscore.param("/roscausal_data/" + name, value)
    with Recording() as recording:
        check_rows(recording.batch(), 19)


@case
def an_unknown_parameter_and_a_forbidden_value_are_told(_):
    with Recording("_ts_lenght:=3") as recording:
        recording.node.line("there is no parameter 'ts_lenght'; did you mean 'ts_length'?")
    group.clean_up()
    with node("data", "_dt:=0") as refused:
        assert refused.ended() == 2, refused.text
        told = [line for line in refused.lines if "parameter 'dt': 0 is not allowed; give a number from 0.001 to 60" in line]
        assert len(told) == 1, refused.text


@case
def every_sighting_of_a_jittering_tracker_counts_in_the_batch(_):
    out = [rospy.Publisher("/mobile_base_controller/odom", Odometry, queue_size=10),
           rospy.Publisher("/robot_pose", PoseWithCovarianceStamped, queue_size=10),
           rospy.Publisher("/ped/control/teleop_persons", TrackedPersons, queue_size=10)]
    seen, random_, folder = [], random.Random(1), tempfile.mkdtemp(dir=os.environ.get("ROSCAUSAL_WORK"), prefix="jitter-")

    def robot(stamp):
        out[0].publish(odometry(stamp))
        out[1].publish(pose(stamp))

    def track(_):
        time.sleep(random_.uniform(0, 0.02))
        stamp = rospy.Time.now()
        seen.append((stamp.to_sec(), 0.5 + random_.uniform(0, 0.5)))
        out[2].publish(person(stamp, [(1000, 3.0, 4.0, seen[-1][1])]))
    given = ["_data_dir:=" + folder, "_pp_data_dir:=%s/pp" % folder, "_ts_length:=6"]
    with node("robot"), node("human"), node("data", *given) as data, Publishing(50, robot), Publishing(12, track):
        path = eventually(lambda: glob.glob(folder + "/data_*.csv"), 40, lambda: "a batch\n" + data.text)[0]
    with open(path, newline="") as file:
        rows = [(float(row["time"]), float(row["h_1000_v"] or "nan")) for row in csv.DictReader(file)]
    off = 0
    # In the first rows it is not known yet how often the tracker sees somebody.
    for t, v in rows[15:]:
        stamp, speed = min(seen, key=lambda one: abs(one[0] - t))
        off += not abs(v - speed) < 1e-4 if abs(stamp - t) < 0.0499 else v == v and abs(stamp - t) > 0.0501
    assert len(rows) == 60 and off == 0, "%d of %d rows are not what the tracker said" % (off, len(rows))
    for publisher in out:
        publisher.unregister()
    return "%d sightings, %d of %d rows off" % (len(seen), off, len(rows))


@case
def a_recorded_bag_is_played_through_the_nodes(_):
    folder = tempfile.mkdtemp(dir=os.environ.get("ROSCAUSAL_WORK"), prefix="bag-")
    out = [rospy.Publisher("/mobile_base_controller/odom", Odometry, queue_size=10),
           rospy.Publisher("/robot_pose", PoseWithCovarianceStamped, queue_size=10)]

    def tick(stamp):
        out[0].publish(odometry(stamp, v=0.125))
        out[1].publish(pose(stamp, x=42))
    with Process("rosbag", "record", "-O", folder + "/in.bag", "/mobile_base_controller/odom", "/robot_pose",
                 "/roscausal/robot") as record:
        with node("robot") as robot, Publishing(20, tick):
            eventually(lambda: all(p.get_num_connections() >= 2 for p in out), 40, lambda: "only %s\n%s\n%s" % (
                [[c.endpoint_id for c in p.impl.connections] for p in out], record.text, robot.text))
            time.sleep(3)
    # rosbag's Python part ends before its recorder has closed the file
    eventually(lambda: os.path.exists(folder + "/in.bag"), 20, lambda: "the bag\n" + record.text)
    for publisher in out:
        publisher.unregister()
    import rosbag
    with rosbag.Bag(folder + "/in.bag") as bag:
        recorded = [m for _, m, _ in bag.read_messages("/roscausal/robot")]
        assert len(recorded) > 20 and recorded[-1].pose2D.x == 42, len(recorded)
        assert recorded[-1]._md5sum == RobotState._md5sum
    states = Collect("/roscausal/robot", RobotState)
    with node("robot"):
        # only the inputs: the node computes the states again
        with Process("rosbag", "play", "-d", "1", folder + "/in.bag", "--topics", "/mobile_base_controller/odom",
                     "/robot_pose") as play:
            state = states.one(lambda m: m.pose2D.x == 42, what="a state from the bag\n" + play.text)
            assert state.twist.linear.x == 0.125
            play.ended(20)


@case
def diagnostics_tell_what_comes_and_what_was_lost(_):
    got = []
    with Recording("_ts_length:=1000") as recording:
        subscriber = rospy.Subscriber("/diagnostics", rospy.AnyMsg, got.append)
        raw = eventually(lambda: got, 15, "diagnostics")[0]
        header = raw._connection_header
        assert header["type"] == "diagnostic_msgs/DiagnosticArray", header
        assert header["md5sum"] == "60810da900de1dd6ddd437c3503511da", header
        kind = genpy.dynamic.generate_dynamic(header["type"], header["message_definition"])[header["type"]]

        def status():
            one = kind().deserialize(got[-1]._buff).status[0]
            return one, {pair.key: pair.value for pair in one.values}
        one, values = status()
        assert one.name == "roscausal_data", one
        eventually(lambda: status()[0].level == 0 and status()[0].message == "running", 10, lambda: status())
        before = int(values["received /roscausal/robot"])
        lost = int(values["lost /roscausal/robot"])
        with recording.robot.impl.publock:  # else a message that is being sent takes the step back
            recording.robot.impl.seq += 7
        eventually(lambda: int(status()[1]["lost /roscausal/robot"]) == lost + 7, 10, lambda: status())
        assert int(status()[1]["received /roscausal/robot"]) > before
    subscriber.unregister()


@case
def a_change_that_nobody_announced_is_told_to_who_comes_late(_):
    folder, told = tempfile.mkdtemp(dir=os.environ.get("ROSCAUSAL_WORK"), prefix="changes-"), []
    switched_off.write(folder)
    with node("discovery", "_data_dir:=" + folder, "_res_dir:=" + folder + "/models", "_cond_ind_test:=parcorr",
              "_cd_method:=pcmci", "_window_batches:=4"):
        eventually(lambda: not glob.glob(folder + "/*.csv"), 60, "the batches analysed")
        subscriber = rospy.Subscriber("/roscausal/model_changes", ModelChanges, told.append)
        eventually(lambda: told and switched_off.confirmed(told[-1]), 20, lambda: told)
    subscriber.unregister()
    return switched_off.check(told[-1])


@case
def no_row_is_lost_while_the_master_restarts(roscore):
    """Last, because this process does not register again."""
    with Recording("_ts_length:=1000") as recording:
        time.sleep(1)
        roscore.stop()
        recording.node.line("lost the ROS master")
        time.sleep(2)
        roscore.start()
        start = time.monotonic()
        eventually(lambda: "/roscausal_data" in roscore.nodes(), 10, "the node on the new master")
        took = time.monotonic() - start
        assert took < 5, took
        time.sleep(1)
        recording.node.send(signal.SIGTERM)
        assert recording.node.ended() == 0, recording.node.text
        rows = recording.batch(1)
        check_rows(rows, 40, flushed=True)
    return "%d rows, back after %.1f s" % (len(rows), took)


if __name__ == "__main__":
    sys.exit(group.run() > 0)
