"""ROS-Causal 1.x on both ends: rospy classes made from its own message definitions, not from this repository's."""

import glob
import os
import sys
import tempfile
import time

import genpy.dynamic
import rospy
from geometry_msgs.msg import PoseWithCovarianceStamped
from nav_msgs.msg import Odometry

from harness import NODE, Group, Process, eventually

group = Group()
case = group.case

XYZ = "float64 x\nfloat64 y\nfloat64 z\n"
PARTS = {
    "std_msgs/Header": "uint32 seq\ntime stamp\nstring frame_id\n",
    "geometry_msgs/Pose2D": "float64 x\nfloat64 y\nfloat64 theta\n",
    "geometry_msgs/Twist": "Vector3 linear\nVector3 angular\n",
    "geometry_msgs/Vector3": XYZ,
    "geometry_msgs/Point": XYZ,
    "std_msgs/MultiArrayDimension": "string label\nuint32 size\nuint32 stride\n",
    "std_msgs/MultiArrayLayout": "MultiArrayDimension[] dim\nuint32 data_offset\n",
    "std_msgs/Int32MultiArray": "MultiArrayLayout layout\nint32[] data\n",
    "std_msgs/Float32MultiArray": "MultiArrayLayout layout\nfloat32[] data\n",
}
STATE = "geometry_msgs/Pose2D pose2D\ngeometry_msgs/Twist twist\ngeometry_msgs/Point goal\n"
ORIGINAL = {
    "RobotState": ("Header header\n" + STATE, "85ccda3e8061a45d573a2a8550778871"),
    "HumanState": ("Header header\nuint32 id\n" + STATE, "90716816acd7c89906d6a039b49fe272"),
    "Humans": ("Header header\nHumanState[] humans\n", "6a4845f7410a9b3ab633d5f388b36b39"),
    "CausalModel": ("Header header\nstring[] features\nstd_msgs/Int32MultiArray causal_structure\n"
                    "std_msgs/Float32MultiArray val_matrix\nstd_msgs/Float32MultiArray pval_matrix\n"
                    "int32[] original_shape\n", "dffe9a6aaf2835bf56c67571594f45fb"),
}


def made(name):
    text, md5 = ORIGINAL[name]
    parts = dict(PARTS)
    if name == "Humans":
        parts["roscausal_msgs/HumanState"] = ORIGINAL["HumanState"][0]
    for part, definition in parts.items():
        text += "=" * 80 + "\nMSG: %s\n%s" % (part, definition)
    classes = genpy.dynamic.generate_dynamic("roscausal_msgs/" + name, text)
    assert classes["roscausal_msgs/" + name]._md5sum == md5, name
    return classes


def got(topic, kind):
    messages = []
    subscriber = rospy.Subscriber(topic, kind, messages.append)
    return subscriber, messages


@case
def its_subscriber_reads_our_robot_state(_):
    RobotState = made("RobotState")["roscausal_msgs/RobotState"]
    odometry = rospy.Publisher("/odom", Odometry, queue_size=10)
    poses = rospy.Publisher("/pose", PoseWithCovarianceStamped, queue_size=10)
    subscriber, states = got("/roscausal/robot", RobotState)

    def publish():
        moving, pose = Odometry(), PoseWithCovarianceStamped()
        moving.header.stamp = pose.header.stamp = rospy.Time.now()
        moving.header.frame_id, moving.child_frame_id, pose.header.frame_id = "odom", "base_footprint", "map"
        moving.pose.pose.orientation.w = pose.pose.pose.orientation.w = 1
        moving.twist.twist.linear.x, pose.pose.pose.position.x = 0.75, -2.5
        odometry.publish(moving)
        poses.publish(pose)
        return states

    with Process(NODE, "robot", "_odom_topic:=/odom", "_pose_topic:=/pose") as robot:
        eventually(publish, 15, lambda: robot.text, period=0.05)
        state = states[0]
        assert state.pose2D.x == -2.5 and state.twist.linear.x == 0.75 and state.header.frame_id == "map", state
    for each in (subscriber, odometry, poses):
        each.unregister()


@case
def its_publishers_states_become_a_batch_and_its_subscriber_reads_our_model(_):
    folder = tempfile.mkdtemp(dir=os.environ.get("ROSCAUSAL_WORK"), prefix="original-")
    RobotState, people = made("RobotState")["roscausal_msgs/RobotState"], made("Humans")
    Humans, HumanState = people["roscausal_msgs/Humans"], people["roscausal_msgs/HumanState"]
    subscriber, models = got("/roscausal/causal_model", made("CausalModel")["roscausal_msgs/CausalModel"])
    out = [rospy.Publisher("/roscausal/robot", RobotState, queue_size=100),
           rospy.Publisher("/roscausal/humans", Humans, queue_size=100)]
    noise = Noise()

    def publish():
        robot, human = RobotState(), HumanState()
        robot.header.stamp, robot.header.frame_id = rospy.Time.now(), "map"
        human.header = robot.header
        robot.pose2D.x, robot.twist.linear.x, robot.goal.x = noise.step("r"), noise.step("v"), 9
        human.id, human.pose2D.x, human.pose2D.y = 1000, 4 + noise.step("x"), noise.step("y")
        human.twist.linear.x, human.goal.x = 1 + noise.step("w"), -9
        out[0].publish(robot)
        out[1].publish(Humans(header=robot.header, humans=[human]))

    with Process(NODE, "data", "_data_dir:=%s/raw" % folder, "_pp_data_dir:=%s/pp" % folder, "_ts_length:=6") as data, \
            Process(NODE, "discovery", "_data_dir:=%s/pp" % folder, "_cd_method:=pcmci", "_cond_ind_test:=parcorr"
                    ) as discovery:
        eventually(lambda: publish() or models, 40, lambda: "a model\n%s\n%s\n%s" % (
            glob.glob(folder + "/*/*"), data.text[-1500:], discovery.text[-1500:]), period=0.02)
        model = models[0]
        assert model.features == ["h_v", "h_dg", "h_risk"] and model.original_shape == (1, 3, 3), model
        assert len(model.causal_structure.data) == len(model.val_matrix.data) == len(model.pval_matrix.data) == 9
        assert model.header.stamp.to_sec() > time.time() - 60, model.header
    for each in (subscriber, *out):
        each.unregister()


class Noise:
    """Named random walks that stay near 0; the same in each run."""

    def __init__(self):
        import random
        self.random, self.values = random.Random(7), {}

    def step(self, name):
        self.values[name] = 0.9 * self.values.get(name, 0) + self.random.gauss(0, 0.2)
        return self.values[name]


if __name__ == "__main__":
    sys.exit(group.run() > 0)
