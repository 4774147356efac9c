"""A fleet: two robots in namespaces with three people. Each robot has its own topics, services, parameters, folders and person."""

import csv
import glob
import os
import signal
import subprocess
import sys
import tempfile

import rospy
from geometry_msgs.msg import PoseWithCovarianceStamped
from nav_msgs.msg import Odometry
from pedsim_msgs.msg import TrackedPersons
from roscausal_msgs.msg import CausalModel, Humans, HumanState, RobotState

from harness import NODE, Group, Process, eventually
from nodes import Collect, Publishing, odometry, person, pose

group = Group()
case = group.case
ROBOTS = ("r1", "r2")
# the robots drive 10 m apart; person 1 is with r1, person 2 with r2, and person 3 with nobody
PEOPLE = {1: (0.0, 2.0), 2: (10.0, 2.0), 3: (5.0, 9.0)}
PEOPLE_TOPIC = "/ped/control/teleop_persons"
NODES = ("robot", "human", "data", "discovery", "reasoning", "markers")


class World:
    """Publishes odometry and pose of both robots, and the people who are `there`, ten times a second."""

    def __init__(self):
        self.there = set(PEOPLE)
        self.tick = 0
        self.out = {}
        for number, robot in enumerate(ROBOTS):
            self.out[robot] = (
                rospy.Publisher("/%s/mobile_base_controller/odom" % robot, Odometry, queue_size=10),
                rospy.Publisher("/%s/robot_pose" % robot, PoseWithCovarianceStamped, queue_size=10), 10.0 * number)
        self.people = rospy.Publisher(PEOPLE_TOPIC, TrackedPersons, queue_size=10)
        self.publishing = Publishing(10, self.publish)

    def publish(self, stamp):
        self.tick += 1
        for odom, poses, x in self.out.values():
            odom.publish(odometry(stamp, v=0.1 * (self.tick % 7)))
            poses.publish(pose(stamp, x=x, y=0.01 * (self.tick % 11)))
        self.people.publish(person(stamp, [
            (number, x + 0.01 * (self.tick % 13), y, 0.1 * (self.tick % 5)) for number, (x, y) in sorted(PEOPLE.items())
            if number in self.there]))

    def __enter__(self):
        self.publishing.__enter__()
        return self

    def __exit__(self, *_):
        self.publishing.__exit__()
        for odom, poses, _ in self.out.values():
            odom.unregister()
            poses.unregister()
        self.people.unregister()


def names(roscore, of=lambda node: True):
    """Topics that nodes publish, topics that they read, and their services."""
    return [{name for name, nodes in kind if any(of(node) for node in nodes)}
            for kind in roscore.master.getSystemState("/harness")[2]]


def ours(robot):
    return lambda node: node.startswith("/%s/roscausal_" % robot)


def fleet(home, *more):
    """Both robots as roslaunch starts them, their folders in `home`."""
    others = {"r1": "r2", "r2": "r1"}
    return [Process("roslaunch", "--disable-title", "roscausal", "roscausal.launch", "namespace:=" + robot,
                    "sel_agent:=%d" % (number + 1), "other_robots:=" + others[robot], "reasoning:=true", "markers:=true",
                    "cd_method:=pcmci", "cond_ind_test:=parcorr", "ts_length:=6", *more, env={"HOME": home})
            for number, robot in enumerate(ROBOTS)]


@case
def each_of_two_robots_has_its_own_person_place_services_and_folders(roscore):
    home = tempfile.mkdtemp(dir=os.environ.get("ROSCAUSAL_WORK"), prefix="fleet-")
    human = {robot: Collect("/%s/roscausal/human" % robot, HumanState) for robot in ROBOTS}
    humans = {robot: Collect("/%s/roscausal/humans" % robot, Humans) for robot in ROBOTS}
    places = {robot: Collect("/%s/roscausal/robot" % robot, RobotState) for robot in ROBOTS}
    models = {robot: Collect("/%s/roscausal/causal_model" % robot, CausalModel) for robot in ROBOTS}
    wrong = [Collect("/roscausal/" + name, kind) for name, kind in (("human", HumanState), ("robot", RobotState))]
    with World() as world:
        launched = fleet(home)
        log = lambda: "\n".join(launch.text[-2500:] for launch in launched)
        expected = {"/%s/roscausal_%s" % (robot, name) for robot in ROBOTS for name in NODES}
        eventually(lambda: expected <= roscore.nodes(), 60, lambda: "%s\n%s" % (roscore.nodes(), log()))
        for number, robot in enumerate(ROBOTS):
            human[robot].one(what="a person\n" + log())
            humans[robot].one(lambda m: {h.id for h in m.humans} == set(PEOPLE), what="all people")
            places[robot].one(what="a place\n" + log())
            models[robot].one(lambda m: m.features, 60, "a model\n" + log())
            heard, read, served = names(roscore, ours(robot))
            own = "/%s/roscausal/" % robot
            others = "/%s/roscausal/" % ROBOTS[1 - number]
            shared = {"/rosout", "/diagnostics"}
            assert {name for name in heard - shared if not name.startswith(own)} == set(), heard
            assert {own + "human", own + "humans", own + "robot", own + "markers", own + "causal_model"} <= heard, heard
            assert {"/%s/mobile_base_controller/odom" % robot, "/%s/robot_pose" % robot, PEOPLE_TOPIC} <= read, read
            # of the other robot its place is recorded, and nothing else is read
            assert {name for name in read if name.startswith("/%s/" % ROBOTS[1 - number])} == {others + "robot"}, read
            questions = {name for name in served if "/roscausal/" in name}
            assert questions >= {own + name for name in ("what_if", "explain", "effect", "route")}, served
            assert all(name.startswith(own) for name in questions), served
        # person 2 leaves: the others are still there, and nobody takes the place
        world.there.discard(2)
        humans["r2"].one(lambda m: {h.id for h in m.humans} == {1, 3}, what="the people without person 2")
        before = len(humans["r2"].all), len(human["r1"].all)
        eventually(lambda: len(humans["r2"].all) > before[0] + 10 and len(human["r1"].all) > before[1] + 10, 10, "more people")
        for launch in launched:
            launch.send(signal.SIGINT)
        codes = [launch.ended(40) for launch in launched]
    assert codes == [0, 0], log()
    for number, robot in enumerate(ROBOTS):
        ids, xs = {m.id for m in human[robot].all}, {round(m.pose2D.x) for m in places[robot].all}
        assert (ids, xs) == ({number + 1}, {10 * number}), (robot, ids, xs)
        folder = "%s/roscausal/%s/" % (home, robot)
        raw, variables = sorted(glob.glob(folder + "data_pool/*.csv")), glob.glob(folder + "pp_pool/*.csv")
        assert raw and variables, (os.listdir(home + "/roscausal"), log())
        with open(raw[0]) as file:
            rows = list(csv.DictReader(file))
        assert {name.split("_")[1] for name in rows[0] if name.startswith("h_")} == {str(number + 1)}, rows[0]
        of_other = "r_%s_x" % ROBOTS[1 - number]
        assert of_other in rows[0], rows[0]
        assert {round(float(row["r_x"])) for row in rows} == {10 * number}, rows[0]
        assert {round(float(row[of_other])) for row in rows if row[of_other]} <= {10 - 10 * number}, rows[0]
    assert sorted(os.listdir(home + "/roscausal")) == list(ROBOTS), os.listdir(home + "/roscausal")
    assert not any(collected.all for collected in wrong), "a message on a topic of the root namespace"
    return "%d and %d sightings" % tuple(len(human[robot].all) for robot in ROBOTS)


@case
def the_nearest_person_is_the_nearest_to_the_robot_of_the_namespace(roscore):
    human = {robot: Collect("/%s/roscausal/human" % robot, HumanState) for robot in ROBOTS}
    with World():
        started = [Process(NODE, name, "__ns:=/" + robot, "__name:=roscausal_" + name, "_sel_agent:=nearest:1")
                   for robot in ROBOTS for name in ("human", "robot")]
        for robot in ROBOTS:
            eventually(lambda: len(human[robot].all) > 20, 20, lambda: "people\n" + "\n".join(p.text for p in started))
    for number, robot in enumerate(ROBOTS):
        assert {m.id for m in human[robot].all} == {number + 1}, (robot, [m.id for m in human[robot].all])


@case
def every_way_into_a_namespace_gives_the_same_names(roscore):
    launch = os.path.join(tempfile.mkdtemp(dir=os.environ.get("ROSCAUSAL_WORK")), "group.launch")
    with open(launch, "w") as file:
        file.write('<launch><group ns="r1"><include file="$(find roscausal)/launch/ros1/robot_state.launch"/></group></launch>')
    # node, its robot, and how it was started; the namespace and `robot` do not add up
    ways = {
        "/r1/a": ("r1", Process(NODE, "robot", "__ns:=/r1", "__name:=a")),
        "/r1/b": ("r1", Process(NODE, "robot", "__ns:=r1", "__name:=b")),
        "/r1/c": ("r1", Process(NODE, "robot", "__name:=c", env={"ROS_NAMESPACE": "/r1/"})),
        "/r1/d": ("r1", Process(NODE, "robot", "__ns:=/r1", "__name:=d", "_robot:=r1")),
        "/r1/e": ("r2", Process(NODE, "robot", "__ns:=/r1", "__name:=e", "_robot:=r2")),
        "/f": ("r1", Process(NODE, "robot", "__name:=f", "_robot:=/r1/")),
        "/r1/roscausal_robot": ("r1", Process("roslaunch", "--disable-title", launch)),
        "/r3/roscausal_robot": ("r3", Process("roslaunch", "--disable-title", "roscausal", "robot_state.launch",
                                              env={"ROS_NAMESPACE": "r3"})),
        "/site/r4/roscausal_robot": ("site/r4", Process("roslaunch", "--disable-title", "roscausal", "roscausal.launch",
                                                        "namespace:=/site/r4")),
    }
    for node, (robot, process) in ways.items():
        read = {"/%s/%s" % (robot, name) for name in ("mobile_base_controller/odom", "robot_pose", "move_base/goal")}
        expected = [{"/%s/roscausal/robot" % robot, "/rosout", "/diagnostics"}, read | {"/tf", "/tf_static"}]
        found = []

        def complete():
            found[:] = names(roscore, lambda name: name == node)[:2]
            return all(len(names) >= len(wanted) for names, wanted in zip(found, expected))
        eventually(complete, 40, lambda: "%s: %s\n%s" % (node, found, process.text))
        assert found == expected, (node, found)


@case
def parameters_of_a_node_are_found_in_its_namespace(roscore):
    # a parameter file, loaded for the whole namespace
    for robot, topic in (("r1", "/one"), ("r2", "/two")):
        roscore.param("/%s/roscausal_human" % robot, {"teleop_people_topic": topic, "sel_agnet": 5})
    roscore.param("/roscausal_human", {"teleop_people_topic": "/none"})
    try:
        with Process(NODE, "human", "__ns:=/r1", "__name:=roscausal_human") as one, \
                Process(NODE, "human", "__ns:=/r2", "__name:=roscausal_human") as two:
            for robot, process, topic in (("r1", one, "/one"), ("r2", two, "/two")):
                eventually(lambda: topic in names(roscore, lambda node: node == "/%s/roscausal_human" % robot)[1], 20,
                           lambda: "a subscription of %s\n%s" % (topic, process.text))
                line = process.line("there is no parameter 'sel_agnet'")
                assert "/%s/roscausal_human" % robot in line and "did you mean 'sel_agent'" in line, line
            assert "/none" not in names(roscore)[1]
    finally:
        for robot in ("", "/r1", "/r2"):
            roscore.master.deleteParam("/harness", robot + "/roscausal_human")


@case
def one_robot_of_a_recorded_fleet_is_found_by_its_name(roscore):
    folder = tempfile.mkdtemp(dir=os.environ.get("ROSCAUSAL_WORK"), prefix="bag-")
    inputs = [PEOPLE_TOPIC] + ["/%s/%s" % (robot, name) for robot in ROBOTS for name in ("mobile_base_controller/odom", "robot_pose")]
    states = ["/%s/roscausal/%s" % (robot, name) for robot in ROBOTS for name in ("robot", "humans")]
    recorded = {folder + "/inputs.bag": inputs, folder + "/states.bag": states}
    with World() as world:
        for robot in ROBOTS:
            for name in ("robot", "human"):
                Process(NODE, name, "__ns:=/" + robot, "__name:=roscausal_" + name)
        records = [Process("rosbag", "record", "-O", bag, *topics) for bag, topics in recorded.items()]

        def connected():
            subscribed = dict(roscore.master.getSystemState("/harness")[2][1])
            return all(any(node.startswith("/record_") for node in subscribed.get(topic, [])) for topic in inputs + states)
        eventually(connected, 40, lambda: "\n".join(record.text for record in records))
        ticks = world.tick
        eventually(lambda: world.tick > ticks + 120, 30, "ticks")
        for record in records:
            record.send(signal.SIGINT)
        # rosbag's Python part ends before its recorder has closed the file
        eventually(lambda: all(map(os.path.exists, recorded)), 20, lambda: "\n".join(record.text for record in records))
    program = os.path.join(os.environ["ROSCAUSAL_TARGET"], os.environ["ROSCAUSAL_PROFILE"], "roscausal")
    for number, robot in enumerate(ROBOTS):
        for bag, what in zip(recorded, ("robot odometry: /%s/mobile_base_controller/odom", "states: /%s/roscausal/robot")):
            out = "%s/%s-%s" % (folder, robot, os.path.basename(bag))
            run = subprocess.run(
                [program, "replay", bag, "--robot", robot, "--person", str(number + 1), "--method", "pcmci", "--test", "parcorr",
                 "--ts-length", "0", "--out", out], capture_output=True, text=True, timeout=120)
            told = run.stdout + run.stderr
            assert run.returncode == 0 and what % robot in told, told
            assert "/%s/" % ROBOTS[1 - number] not in told, told
            with open(glob.glob(out + "/data_pool/*.csv")[0]) as file:
                rows = list(csv.DictReader(file))
            assert len(rows) > 80 and {round(float(row["r_x"])) for row in rows if row["r_x"]} == {10 * number}, (bag, robot, rows[:1])
            assert {name.split("_")[1] for name in rows[0] if name.startswith("h_")} == {str(number + 1)}, rows[0]


if __name__ == "__main__":
    sys.exit(group.run() > 0)
