"""The whole experiment with roslaunch: simulator and four nodes in simulated time. A rospy script gets the model."""

import glob
import math
import os
import random
import re
import signal
import sys
import tempfile
import urllib.request

import rospy
from geometry_msgs.msg import PoseWithCovarianceStamped
from move_base_msgs.msg import MoveBaseActionGoal
from nav_msgs.msg import Odometry
from pedsim_msgs.msg import TrackedPerson, TrackedPersons
from roscausal_msgs.msg import CausalModel, CausalModelInfo
from sensor_msgs.msg import Image
from visualization_msgs.msg import MarkerArray

from harness import Group, Process, eventually

group = Group()
case = group.case
NODES = {"/roscausal_%s" % name for name in ("robot", "human", "data", "discovery", "hrisim", "dashboard", "markers")}


@case
def roslaunch_runs_the_experiment_and_a_model_arrives(roscore):
    folder = tempfile.mkdtemp(dir=os.environ.get("ROSCAUSAL_WORK"), prefix="experiment-")
    # this process uses real time
    got = {"models": [], "clock": []}
    rospy.Subscriber("/roscausal/causal_model", CausalModel, got["models"].append)
    from rosgraph_msgs.msg import Clock
    rospy.Subscriber("/clock", Clock, lambda m: got["clock"].append(m.clock.to_sec()))
    with Process("roslaunch", "roscausal", "experiment.launch", "speed:=5", "ts_length:=60", "duration:=1000", "seed:=3",
                 "scenario:=pass_by_the_centre", "data_dir:=%s/data" % folder, "pp_data_dir:=%s/pp" % folder,
                 "res_dir:=%s/models" % folder, "dashboard:=true", "dashboard_port:=0", "markers:=true") as launch:
        eventually(lambda: NODES <= roscore.nodes(), 40, lambda: "%s\n%s" % (roscore.nodes(), launch.text[-3000:]))
        address = eventually(lambda: re.search(r"the page is at (http://127\.0\.0\.1:\d+/)", launch.text), 10, "the page's address")
        page = urllib.request.urlopen(address[1], timeout=10).read().decode()
        assert "<html" in page and "Causal model" in page, page[:300]
        markers = rospy.wait_for_message("/roscausal/markers", MarkerArray, 20).markers
        # a robot and people, in one frame
        assert len(markers) >= 2 and {m.header.frame_id for m in markers} == {"map"}, markers
        # a batch without links is a valid result, but of no use here
        model = eventually(
            lambda: next((m for m in got["models"] if m.features), None), 150,
            lambda: "a model with links; %d came, clock %s, files %s\n%s" % (
                len(got["models"]), got["clock"][-1:], glob.glob(folder + "/*/*"), launch.text[-3000:]), period=0.2)
        check(model)
        # another process, because this one is connected already
        with Process("rostopic", "echo", "-n", "1", "/roscausal/causal_model") as late:
            late.ended(20)
            assert "original_shape:" in late.text and 'label: "target"' in late.text, late.text
        info = rospy.wait_for_message("/roscausal/causal_model_info", CausalModelInfo, 10)
        assert info.n_samples > 500 and abs(info.dt - 0.1) < 1e-9, info
        assert info.method == "fpcmci" and info.cond_ind_test == "gpdc", info
        for topic in ("/roscausal/dag", "/roscausal/tsdag"):
            image = rospy.wait_for_message(topic, Image, 10)
            assert image.width > 50 and len(image.data) == image.step * image.height, topic
            assert len(set(image.data)) > 1, topic + " is blank"
        eventually(lambda: glob.glob(folder + "/models/*"), 10, "files of the model")
        launch.send(signal.SIGINT)
        launch.ended(40)
        eventually(lambda: not NODES & roscore.nodes(), 5, lambda: "ghosts: %s" % (NODES & roscore.nodes()))
    links = sum(model.causal_structure.data)
    return "%s, %d links" % (", ".join(model.features), links)


@case
def roslaunch_runs_the_four_nodes_on_rospys_robot_and_people(roscore):
    folder = tempfile.mkdtemp(dir=os.environ.get("ROSCAUSAL_WORK"), prefix="robot-")
    roscore.param("/use_sim_time", False)
    roscore.param("/hri/human_goal", [6.0, 0.0])
    out = {name: rospy.Publisher(name, kind, queue_size=10, latch=name == "/my/goal") for name, kind in (
        ("/my/odom", Odometry), ("/my/pose", PoseWithCovarianceStamped), ("/my/goal", MoveBaseActionGoal),
        ("/my/people", TrackedPersons))}
    goal = MoveBaseActionGoal()
    goal.goal.target_pose.header.frame_id, goal.goal.target_pose.pose.orientation.w = "map", 1
    goal.goal.target_pose.pose.position.x = -4
    out["/my/goal"].publish(goal)
    models, rng, walk = [], random.Random(5), {}

    def step(name):
        walk[name] = 0.95 * walk.get(name, 0) + rng.gauss(0, 0.1)
        return walk[name]

    def publish():
        now = rospy.Time.now()
        odometry, pose, people, track = Odometry(), PoseWithCovarianceStamped(), TrackedPersons(), TrackedPerson()
        for message, frame in ((odometry, "odom"), (pose, "map"), (people, "map")):
            message.header.stamp, message.header.frame_id = now, frame
        odometry.child_frame_id = "base_footprint"
        odometry.pose.pose.orientation.w = pose.pose.pose.orientation.w = track.pose.pose.orientation.w = 1
        odometry.twist.twist.linear.x, pose.pose.pose.position.x = 0.5 + step("v"), step("x")
        track.track_id, track.pose.pose.position.x, track.pose.pose.position.y = 1000, 2 + step("hx"), step("hy")
        track.twist.twist.linear.x = 1 + step("hv")
        people.tracks.append(track)
        out["/my/odom"].publish(odometry)
        out["/my/pose"].publish(pose)
        out["/my/people"].publish(people)

    subscriber = rospy.Subscriber("/roscausal/causal_model", CausalModel, models.append)
    with Process("roslaunch", "roscausal", "roscausal.launch", "odom_topic:=/my/odom", "pose_topic:=/my/pose",
                 "goal_topic:=/my/goal", "teleop_people_topic:=/my/people", "ts_length:=8", "cd_method:=pcmci",
                 "cond_ind_test:=parcorr", "data_dir:=%s/data" % folder, "pp_data_dir:=%s/pp" % folder,
                 "res_dir:=%s/models" % folder) as launch:
        eventually(lambda: publish() or models, 60, lambda: "a model; files %s\n%s" % (
            glob.glob(folder + "/*/*"), launch.text[-3000:]), period=0.05)
        model = models[0]
        assert model.features == ["h_v", "h_dg", "h_risk"] and model.original_shape == (1, 3, 3), model
        assert all(len(m.data) == 9 for m in (model.causal_structure, model.val_matrix, model.pval_matrix)), model
        rows = open(glob.glob(folder + "/data/*.csv")[0]).read().splitlines()
        first = dict(zip(rows[0].split(","), rows[1].split(",")))
        assert float(first["r_gx"]) == -4 and float(first["h_1000_gx"]) == 6, first
        launch.send(signal.SIGINT)
        launch.ended(40)
    for publisher in (subscriber, *out.values()):
        publisher.unregister()
    return "%d rows" % (len(rows) - 1)


def check(model):
    assert model.header.stamp.to_sec() > 0, model.header
    lags, effects, causes = model.original_shape
    assert [d.label for d in model.val_matrix.layout.dim] == ["lag", "target", "source"], model.val_matrix.layout
    assert effects == causes == len(model.features) and lags >= 1, model
    assert set(model.features) <= {"h_v", "h_dg", "h_risk"} and model.features, model.features
    size = effects * causes * lags
    for matrix in (model.causal_structure, model.val_matrix, model.pval_matrix):
        assert len(matrix.data) == size, matrix
    assert set(model.causal_structure.data) <= {0, 1} and any(model.causal_structure.data), "no link"
    assert all(math.isfinite(v) for v in model.val_matrix.data), model.val_matrix
    assert all(0 <= p <= 1 for p in model.pval_matrix.data), model.pval_matrix
    for link, value in zip(model.causal_structure.data, model.val_matrix.data):
        assert link or value == 0, "a value without link"


if __name__ == "__main__":
    sys.exit(group.run() > 0)
