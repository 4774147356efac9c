"""Simulated time that starts late, stops and jumps back."""

import sys
import time

import rospy
from rosgraph_msgs.msg import Clock

from harness import Group, eventually, peer

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


if __name__ == "__main__":
    # a node of this process must not take the simulated time for its own
    sys.exit(group.run() > 0)
