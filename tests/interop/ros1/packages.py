"""The catkin packages from a plain clone: every build tool, rosmsg, rosrun, roslaunch, the install space."""

import os
import shutil
import subprocess
import sys

import yaml

from harness import Group, Process, eventually

group = Group()
case = group.case
ROOT, TARGET, WORK = (os.environ["ROSCAUSAL_" + name] for name in ("ROOT", "TARGET", "WORK"))
PROFILE = os.environ["ROSCAUSAL_PROFILE"]
CMAKE = ["-DPYTHON_EXECUTABLE=/usr/bin/python3", "-DROSCAUSAL_PROFILE=" + PROFILE, "-DROSCAUSAL_CARGO_TARGET_DIR=" + TARGET]


def workspace(name, source=ROOT):
    path = os.path.join(WORK, name)
    os.makedirs(path + "/src")
    os.symlink(source, path + "/src/roscausal")
    return path


def clean_env():
    gone = ("ROS_PACKAGE_PATH", "CMAKE_PREFIX_PATH", "PYTHONPATH", "ROS_VERSION", "ROS_DISTRO", "LD_LIBRARY_PATH",
            "PKG_CONFIG_PATH", "ROSLISP_PACKAGE_DIRECTORIES")
    return {key: value for key, value in os.environ.items() if key not in gone}


def run(command, path, timeout=1200):
    # catkin_make_isolated uses PWD
    done = subprocess.run(command, cwd=path, env={**clean_env(), "PWD": path}, capture_output=True, text=True, timeout=timeout)
    assert done.returncode == 0, "%s\n%s\n%s" % (command, done.stdout[-1500:], done.stderr[-1500:])
    return done.stdout


def works(setup, roscore):
    """Runs commands as a user of the sourced workspace would."""
    script = """set -e; . %s
      rosmsg md5 roscausal_msgs/CausalModel
      rosmsg show roscausal_msgs/RobotState
      python3 -c 'from roscausal_msgs.msg import CausalModel, CausalModelInfo, ModelChanges; print("imported")'
      roslaunch --files roscausal roscausal.launch
      roslaunch --nodes roscausal experiment.launch
    """ % setup
    out = run(["bash", "-c", script], WORK)
    for part in ("dffe9a6aaf2835bf56c67571594f45fb", "geometry_msgs/Pose2D pose2D", "imported", "causal_discovery.launch",
                 "/roscausal_hrisim"):
        assert part in out, "no %r in %s" % (part, out)
    for node in ("robot", "human", "data", "discovery", "hrisim"):
        command = ". %s; exec rosrun roscausal roscausal_%s _data_dir:=%s/rosrun/raw _pp_data_dir:=%s/rosrun/pp" % (
            setup, node, WORK, WORK)
        with Process("bash", "-c", command) as started:
            eventually(lambda: "/roscausal_" + node in roscore.nodes(), 20, lambda: started.text)


@case
def catkin_makes_devel_space_is_complete(roscore):
    works(os.environ["ROSCAUSAL_TEST_WS"] + "/devel/setup.bash", roscore)


@case
def catkin_build_builds_it(roscore):
    path = workspace("ws_tools")
    run(["catkin", "config", "--cmake-args"] + CMAKE, path)
    run(["catkin", "build", "--no-status", "--summarize"], path)
    works(path + "/devel/setup.bash", roscore)


@case
def catkin_make_isolated_installs_a_plain_clone(roscore):
    """A clone of the last commit, so that only files in git are used. To cargo two checkouts of one
    repository are the same, so the clone has a target folder of its own, with the libraries that are already built."""
    scratch = TARGET + "/.interop_ros1"
    shutil.rmtree(scratch, ignore_errors=True)
    os.makedirs("%s/target/%s" % (scratch, PROFILE))
    built = "%s/%s" % (TARGET, PROFILE)
    # under cargo's own lock: a build going on beside this would take files away while they are copied
    run(["flock", built + "/.cargo-lock", "cp", "-a", *("%s/%s" % (built, part) for part in ("deps", "build", ".fingerprint")),
         "%s/target/%s" % (scratch, PROFILE)], WORK, 580)
    # works even if the sources themselves are not a clone
    source = ROOT if not os.path.exists(ROOT + "/.git") else scratch + "/roscausal"
    if source != ROOT:
        run(["git", "clone", "-q", ROOT, source], WORK)
    path = workspace("ws_isolated", source)
    run(["catkin_make_isolated", "--install", *CMAKE[:2], "-DROSCAUSAL_CARGO_TARGET_DIR=%s/target" % scratch], path, 580)
    works(path + "/install_isolated/setup.bash", roscore)
    shutil.rmtree(scratch)


@case
def roslaunch_has_the_originals_names_and_defaults(_):
    expected = {
        "robot": {"odom_topic": "/mobile_base_controller/odom", "pose_topic": "/robot_pose",
                  "goal_topic": "/move_base/goal", "source_frame": "base_footprint", "target_frame": "map"},
        "human": {"auto_people_topic": "/pedsim_simulator/simulated_agents",
                  "teleop_people_topic": "/ped/control/teleop_persons", "goal_param": "/hri/human_goal",
                  "target_frame": "map"},
        "data": {"pp_script_dir": "", "pp_script": "", "ts_length": "150", "subsampling": False, "dt": 0.1,
                 "id_format": "%Y%m%d_%H%M%S", "csv_prefix": "data_", "obs_size": 2.0, "safe_dist": 5.0,
                 "sel_agent": 1000, "delete_traj": False},
        "discovery": {"res_dir": "", "cd_method": "fpcmci", "sig_alpha": 0.05, "min_lag": 1, "max_lag": 1,
                      "id_format": "%Y%m%d_%H%M%S", "csv_prefix": "data_"},
    }
    setup = os.environ["ROSCAUSAL_TEST_WS"] + "/devel/setup.bash"
    dumped = yaml.safe_load(run(["bash", "-c", ". %s; roslaunch --dump-params roscausal roscausal.launch" % setup], WORK))
    for node, params in expected.items():
        for name, value in params.items():
            assert dumped["/roscausal_%s/%s" % (node, name)] == value, (node, name, dumped)
    # every one of them is an argument, too
    names = " ".join("%s:=%s" % (name, {"dt": "0.2"}.get(name, value if value != "" else "/x"))
                     for params in expected.values() for name, value in params.items())
    again = run(["bash", "-c", ". %s; roslaunch --dump-params roscausal roscausal.launch %s" % (setup, names)], WORK)
    again = yaml.safe_load(again)
    assert again["/roscausal_data/dt"] == 0.2 and again["/roscausal_discovery/res_dir"] == "/x", again


if __name__ == "__main__":
    sys.exit(group.run(node=False) > 0)
