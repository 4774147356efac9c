"""A master that is killed and restarted: connections stay, nodes register again, new nodes find them."""

import sys
import time

import rospy
from roscausal_msgs.msg import Humans
from std_msgs.msg import String

from harness import Group, eventually, peer

group = Group()
case = group.case


@case
def no_message_is_lost_and_nodes_are_back_within_five_seconds(roscore):
    """rospy -> peer -> peer -> rospy, 50 messages a second, while the master is stopped and restarted."""
    got = []
    out = rospy.Publisher("/a", Humans, queue_size=1000)
    rospy.Subscriber("/c", Humans, lambda m: got.append(int(m.header.frame_id)))
    with peer("echo", "roscausal_msgs/Humans", "/a", "/b", "__name:=one") as one, \
            peer("echo", "roscausal_msgs/Humans", "/b", "/c", "__name:=two") as two:
        sent = 0

        def send(seconds):
            nonlocal sent
            end = time.monotonic() + seconds
            while time.monotonic() < end:
                message = Humans()
                message.header.frame_id = str(sent)
                out.publish(message)
                sent += 1
                time.sleep(0.02)

        def through():
            send(0.05)
            return got
        eventually(through, 15, lambda: "a message through\n%s\n%s" % (one.text, two.text))
        time.sleep(0.5)
        first = got[-1] + 1
        sent = max(sent, first)
        send(1)
        roscore.stop()
        one.line("lost the ROS master")
        send(2)
        roscore.start()
        start = time.monotonic()
        eventually(lambda: send(0.1) or {"/one", "/two"} <= roscore.nodes(), 10, lambda: str(roscore.nodes()))
        took = time.monotonic() - start
        assert took < 5, "%.1f s" % took
        one.line("registering again")
        send(1)
        eventually(lambda: sent - 1 in got, 5, "the last message")
        missing = sorted(set(range(first, sent)) - set(got))
        assert not missing, "%d of %d lost: %s" % (len(missing), sent - first, missing[:20])
        assert len(got) == len(set(got)), "some came twice"
        topics = {name for name, _ in roscore.master.getPublishedTopics("/t", "")[2]}
        assert {"/b", "/c", "/rosout"} <= topics, topics
    return "%d messages, back after %.1f s" % (sent - first, took)


@case
def nodes_started_after_the_restart_are_connected(roscore):
    """New nodes find the old ones, and are found by them."""
    with peer("latch", "/kept", "kept", "__name:=old_publisher"), \
            peer("count", "std_msgs/String", "/news", "__name:=old_subscriber") as old:
        eventually(lambda: {"/old_publisher", "/old_subscriber"} <= roscore.nodes(), 10, "both nodes")
        roscore.stop()
        old.line("lost the ROS master")
        roscore.start()
        with peer("latch", "/news", "news", "__name:=new_publisher"), \
                peer("count", "std_msgs/String", "/kept", "__name:=new_subscriber") as new:
            old.line("1 0", 15)
            new.line("1 0", 15)


@case
def parameters_of_the_new_master_are_read(roscore):
    roscore.param("/fresh", 1)
    with peer("param", "/fresh") as first:
        first.ended()
        assert "/fresh Some(Int(1))" in first.lines, first.text
    roscore.stop()
    roscore.start()
    with peer("param", "/fresh") as second:
        second.ended()
        assert "/fresh None" in second.lines, second.text


if __name__ == "__main__":
    sys.exit(group.run() > 0)
