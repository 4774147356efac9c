"""A fleet: two robots in namespaces with three people. Each robot has its own topics, folders and person."""

import csv
import glob
import os
import signal
import tempfile

from geometry_msgs.msg import PoseWithCovarianceStamped
from nav_msgs.msg import Odometry

from harness import Ros, node, test
from nodes import Sending, heard, odometry, pose
from wire import message_class

ROBOTS = ("r1", "r2")
# the robots drive 10 m apart; person 1 is with r1, person 2 with r2, and person 3 with nobody
PEOPLE = {1: (0.0, 2.0), 2: (10.0, 2.0), 3: (5.0, 9.0)}
# for the nodes of any namespace, as in config/ros2.yaml
PARAMETERS = """
/**/roscausal_robot: {ros__parameters: {pose_topic: /robot_pose}}
/**/roscausal_human: {ros__parameters: {teleop_people_topic: /people}}
/**/roscausal_data: {ros__parameters: {ts_length: 4.0}}
"""


@test
def each_of_two_robots_has_its_own_person_place_and_folders():
    HumanState, Humans = message_class("roscausal_msgs/HumanState"), message_class("roscausal_msgs/Humans")
    RobotState, Tracked = message_class("roscausal_msgs/RobotState"), message_class("pedsim_msgs/TrackedPersons")
    Track = message_class("pedsim_msgs/TrackedPerson")
    with tempfile.TemporaryDirectory() as home, Ros() as ros:
        with open(home + "/fleet.yaml", "w") as file:
            file.write(PARAMETERS)
        human = {robot: heard(ros, HumanState, f"/{robot}/roscausal/human", 100) for robot in ROBOTS}
        humans = {robot: heard(ros, Humans, f"/{robot}/roscausal/humans", 100) for robot in ROBOTS}
        places = {robot: heard(ros, RobotState, f"/{robot}/roscausal/robot", 100) for robot in ROBOTS}
        out = {
            robot: (ros.node.create_publisher(Odometry, f"/{robot}/odom", 10),
                    ros.node.create_publisher(PoseWithCovarianceStamped, f"/{robot}/robot_pose", 10), 10.0 * number)
            for number, robot in enumerate(ROBOTS)
        }
        people, there = ros.node.create_publisher(Tracked, "/people", 10), set(PEOPLE)

        def tick(stamp):
            for odom, poses, x in out.values():
                odom.publish(odometry(stamp))
                poses.publish(pose(stamp, x=x))
            message = Tracked()
            message.header.stamp, message.header.frame_id = stamp, "map"
            for number in sorted(there):
                track = Track(track_id=number)
                track.pose.pose.position.x, track.pose.pose.position.y = PEOPLE[number]
                track.pose.pose.orientation.w = 1.0
                message.tracks.append(track)
            people.publish(message)

        def started(robot, number, name):
            more = {"human": [f"sel_agent:='{number}'"], "data": [f"sel_agent:='{number}'", f"other_robots:=[{ROBOTS[2 - number]}]"]}
            words = [word for one in more.get(name, []) for word in ("-p", one)]
            return node(name, "-r", f"__ns:=/{robot}", "--params-file", home + "/fleet.yaml", *words, env={"HOME": home})

        programs = [started(robot, number, name) for number, robot in enumerate(ROBOTS, 1) for name in ("robot", "human", "data")]
        try:
            with Sending(ros, tick):
                for robot in ROBOTS:
                    ros.until(lambda: human[robot] and places[robot], 20, f"a person and a place of {robot}")
                    ros.until(lambda: glob.glob(f"{home}/roscausal/{robot}/pp_pool/*.csv"), 20, f"a batch of {robot}")
                # person 2 leaves: the others are still there, and nobody takes the place
                there.discard(2)
                ros.until(lambda: {h.id for h in humans["r2"][-1].humans} == {1, 3}, 10, "the people without person 2")
                ros.spin(2)
            for program in programs:
                program.send(signal.SIGINT)
            assert [program.wait() for program in programs] == [0] * len(programs)
        finally:
            for program in programs:
                program.__exit__(None)
        topics = {name for name, _ in ros.node.get_topic_names_and_types()}
        assert not any(name.startswith("/roscausal/") for name in topics), topics
        for number, robot in enumerate(ROBOTS, 1):
            ids, xs = {m.id for m in human[robot]}, {round(m.pose2d.x) for m in places[robot]}
            assert (ids, xs) == ({number}, {10 * number - 10}), (robot, ids, xs)
            with open(sorted(glob.glob(f"{home}/roscausal/{robot}/data_pool/*.csv"))[0]) as file:
                rows = list(csv.DictReader(file))
            assert {name.split("_")[1] for name in rows[0] if name.startswith("h_")} == {str(number)}, rows[0]
            other = f"r_{ROBOTS[2 - number]}_x"
            assert {round(float(row["r_x"])) for row in rows} == {10 * number - 10}, rows[0]
            assert {round(float(row[other])) for row in rows if row[other]} == {20 - 10 * number}, rows[0]
        assert sorted(os.listdir(home + "/roscausal")) == list(ROBOTS)
    return "%d and %d sightings" % tuple(len(human[robot]) for robot in ROBOTS)
