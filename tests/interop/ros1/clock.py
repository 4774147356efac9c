"""Simulated time that starts late, stops and jumps back."""

import csv
import glob
import os
import signal
import sys
import tempfile
import time

import rospy
from roscausal_msgs.msg import Humans, HumanState, RobotState
from rosgraph_msgs.msg import Clock

from harness import NODE, Group, Process, eventually, peer

group = Group()
case = group.case


def tell(publisher, seconds, count=3):
    for _ in range(count):
        publisher.publish(Clock(rospy.Time.from_sec(seconds)))
        time.sleep(0.02)


@case
def time_is_that_of_the_clock_topic_late_stopped_or_jumping_back(roscore):
    roscore.param("/use_sim_time", True)
    with peer("clock", "__name:=watch") as watch:
        line = watch.line("/clock has been silent for 5 s", 15)
        assert "use_sim_time" in line, line
        assert "0" in watch.lines and not any(l.startswith("1") and l.replace(".", "").isdigit() for l in watch.lines)
        publisher = rospy.Publisher("/clock", Clock, queue_size=10)
        eventually(lambda: publisher.get_num_connections() >= 1, 10, "the watch")
        eventually(lambda: tell(publisher, 100.5) or "100.5" in watch.lines, 10, lambda: watch.text)
        watch.line("/clock runs again")
        tell(publisher, 101.0)
        watch.line("101")
        tell(publisher, 7.25)
        watch.line("jumped back from 101.000 s to 7.250 s")
        watch.line("7.25")
        count = len(watch.lines)
        watch.line("/clock has been silent for 5 s: time stands at 7.250 s", 15, start=count)
    publisher.unregister()
    roscore.param("/use_sim_time", False)


@case
def time_is_the_systems_without_simulation(roscore):
    roscore.param("/use_sim_time", "False")
    with peer("clock", "__name:=watch2") as watch:
        eventually(lambda: watch.lines, 10, "a time")
        now = next(float(l) for l in watch.lines if l.replace(".", "").isdigit())
        assert abs(now - time.time()) < 5, watch.text


@case
def a_node_records_on_through_a_clock_that_is_late_stops_and_jumps_back(roscore):
    roscore.param("/use_sim_time", True)
    folder = tempfile.mkdtemp(dir=os.environ.get("ROSCAUSAL_WORK"), prefix="clock-")
    clock = rospy.Publisher("/clock", Clock, queue_size=10)
    robots = rospy.Publisher("/roscausal/robot", RobotState, queue_size=10)
    people = rospy.Publisher("/roscausal/humans", Humans, queue_size=10)

    def run(start, seconds):
        """This many simulated seconds, at twice real time."""
        for step in range(int(seconds * 50)):
            now = rospy.Time.from_sec(start + step / 50)
            robot, human = RobotState(), HumanState(id=1000)
            robot.header.stamp, robot.header.frame_id = now, "map"
            human.header = robot.header
            clock.publish(Clock(now))
            robots.publish(robot)
            people.publish(Humans(header=robot.header, humans=[human]))
            time.sleep(0.01)

    with Process(NODE, "data", "_data_dir:=" + folder, "_pp_data_dir:=%s/pp" % folder, "_ts_length:=1000") as data:
        eventually(lambda: all(p.get_num_connections() for p in (clock, robots, people)), 15, lambda: data.text)
        time.sleep(1)
        run(100, 6)
        time.sleep(1)
        run(107, 3)
        run(20, 6)
        data.line("jumped back from")
        data.send(signal.SIGTERM)
        assert data.ended() == 0, data.text
    times = []
    for path in glob.glob(folder + "/*.csv"):
        with open(path, newline="") as file:
            rows = [float(row["time"]) for row in csv.DictReader(file)]
        assert all(0.09 < b - a < 0.11 for a, b in zip(rows, rows[1:])), (path, rows)
        times += rows
    for low, high in ((100.1, 105.9), (107.1, 109.9), (20.1, 25.9)):
        wanted = round((high - low) / 0.1)
        there = sum(low <= at <= high for at in times)
        assert there >= wanted - 1, "%d rows of %d from %g to %g s: %s" % (there, wanted, low, high, times)
    for publisher in (clock, robots, people):
        publisher.unregister()
    roscore.param("/use_sim_time", False)
    return "%d rows in %d batches" % (len(times), len(glob.glob(folder + "/*.csv")))


@case
def a_signal_ends_a_node_whose_clock_never_comes(roscore):
    roscore.param("/use_sim_time", True)
    folder = tempfile.mkdtemp(dir=os.environ.get("ROSCAUSAL_WORK"), prefix="clock-")
    with Process(NODE, "data", "_data_dir:=" + folder, "_pp_data_dir:=%s/pp" % folder) as data:
        eventually(lambda: "/roscausal_data" in roscore.nodes(), 10, lambda: data.text)
        time.sleep(0.5)
        data.send(signal.SIGTERM)
        assert data.ended(3) == 0, data.text
    assert "/roscausal_data" not in roscore.nodes()
    roscore.param("/use_sim_time", False)


if __name__ == "__main__":
    # a node in this process must not use the simulated time
    sys.exit(group.run() > 0)
