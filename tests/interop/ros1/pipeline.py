"""The whole experiment by roslaunch: simulator and four nodes in simulated time, a rospy script gets the model."""

import glob
import math
import os
import signal
import sys
import tempfile

import rospy
from roscausal_msgs.msg import CausalModel, CausalModelInfo
from sensor_msgs.msg import Image

from harness import Group, Process, eventually

group = Group()
case = group.case
NODES = {"/roscausal_%s" % name for name in ("robot", "human", "data", "discovery", "hrisim")}


@case
def roslaunch_runs_the_experiment_and_a_model_arrives(roscore):
    folder = tempfile.mkdtemp(dir=os.environ.get("ROSCAUSAL_WORK"), prefix="experiment-")
    # this process goes by real time
    got = {"models": [], "clock": []}
    rospy.Subscriber("/roscausal/causal_model", CausalModel, got["models"].append)
    from rosgraph_msgs.msg import Clock
    rospy.Subscriber("/clock", Clock, lambda m: got["clock"].append(m.clock.to_sec()))
    with Process("roslaunch", "roscausal", "experiment.launch", "speed:=10", "ts_length:=60", "duration:=1000", "seed:=3",
                 "scenario:=pass_by_the_centre", "data_dir:=%s/data" % folder, "pp_data_dir:=%s/pp" % folder,
                 "res_dir:=%s/models" % folder) as launch:
        eventually(lambda: NODES <= roscore.nodes(), 40, lambda: "%s\n%s" % (roscore.nodes(), launch.text[-3000:]))
        eventually(lambda: got["models"], 150, lambda: "a model; clock %s, files %s\n%s" % (
            got["clock"][-1:], glob.glob(folder + "/*/*"), launch.text[-3000:]), period=0.2)
        model = got["models"][0]
        check(model)
        late = rospy.wait_for_message("/roscausal/causal_model", CausalModel, 10)
        check(late)
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
