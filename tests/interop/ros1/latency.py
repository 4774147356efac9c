"""Figures, not tests: how long a message takes there and back, through this backend and through rospy."""

import statistics
import sys
import time

import rospy
from nav_msgs.msg import Odometry

from harness import Group, Process, eventually, peer

group = Group()

RELAY = """
import rospy
from nav_msgs.msg import Odometry
rospy.init_node("relay")
out = rospy.Publisher("/back", Odometry, queue_size=100, tcp_nodelay=True)
rospy.Subscriber("/there", Odometry, out.publish, tcp_nodelay=True)
rospy.spin()
"""


def measured(process):
    arrived = []
    out = rospy.Publisher("/there", Odometry, queue_size=100, tcp_nodelay=True)
    back = rospy.Subscriber("/back", Odometry, lambda m: arrived.append((m.header.frame_id, time.perf_counter())),
                            tcp_nodelay=True)
    with process as relay:
        eventually(lambda: out.get_num_connections() and back.get_num_connections(), 20, lambda: relay.text)
        time.sleep(0.5)
        sent = {}
        for number in range(1000):
            message = Odometry()
            message.header.frame_id = str(number)
            sent[str(number)] = time.perf_counter()
            out.publish(message)
            time.sleep(0.005)
        time.sleep(0.5)
    took = sorted(1e6 * (at - sent[name]) for name, at in arrived if name in sent)
    out.unregister()
    back.unregister()
    return "%d of 1000; there and back median %.0f us, 99 %% below %.0f us" % (
        len(took), statistics.median(took), took[int(len(took) * 0.99) - 1])


@group.case
def through_this_backend(_):
    return measured(peer("echo", "nav_msgs/Odometry", "/there", "/back"))


@group.case
def through_rospy(_):
    return measured(Process("/usr/bin/python3", "-c", RELAY))


if __name__ == "__main__":
    sys.exit(group.run() > 0)
