"""The catkin packages from a plain clone: every build tool, rosmsg, rosrun, roslaunch, the install space."""

import os
import subprocess
import sys

from harness import Group, Process, eventually

group = Group()
case = group.case
ROOT, TARGET, WORK = (os.environ["ROSCAUSAL_" + name] for name in ("ROOT", "TARGET", "WORK"))
CMAKE = ["-DPYTHON_EXECUTABLE=/usr/bin/python3", "-DROSCAUSAL_CARGO_TARGET_DIR=" + TARGET]


def workspace(name):
    path = os.path.join(WORK, name)
    os.makedirs(path + "/src")
    os.symlink(ROOT, path + "/src/roscausal")
    return path


def clean_env():
    gone = ("ROS_PACKAGE_PATH", "CMAKE_PREFIX_PATH", "PYTHONPATH", "ROS_VERSION", "ROS_DISTRO", "LD_LIBRARY_PATH",
            "PKG_CONFIG_PATH", "ROSLISP_PACKAGE_DIRECTORIES")
    return {key: value for key, value in os.environ.items() if key not in gone}


def run(command, path, timeout=280):
    done = subprocess.run(command, cwd=path, env=clean_env(), capture_output=True, text=True, timeout=timeout)
    assert done.returncode == 0, "%s\n%s\n%s" % (command, done.stdout[-1500:], done.stderr[-1500:])
    return done.stdout


def works(setup):
    """What a user of the sourced workspace does."""
    script = """set -e; . %s
      rosmsg md5 roscausal_msgs/CausalModel
      rosmsg show roscausal_msgs/RobotState
      python3 -c 'from roscausal_msgs.msg import CausalModel, CausalModelInfo; print("imported")'
      roslaunch --files roscausal roscausal.launch
      roslaunch --nodes roscausal experiment.launch
      rosrun roscausal roscausal_ros1 nothing || echo "usage code $?"
    """ % setup
    out = run(["bash", "-c", script], WORK)
    for part in ("dffe9a6aaf2835bf56c67571594f45fb", "geometry_msgs/Pose2D pose2D", "imported", "causal_discovery.launch",
                 "/roscausal_hrisim", "usage code 2"):
        assert part in out, "no %r in %s" % (part, out)
    return out


@case
def catkin_makes_devel_space_is_complete(roscore):
    works(os.environ["ROSCAUSAL_TEST_WS"] + "/devel/setup.bash")
    for node in ("robot", "human", "data", "discovery"):
        with Process("rosrun", "roscausal", "roscausal_" + node, "_data_dir:=%s/rosrun" % WORK,
                     "_pp_data_dir:=%s/rosrun" % WORK) as started:
            eventually(lambda: "/roscausal_" + node in roscore.nodes(), 20, lambda: started.text)


@case
def catkin_build_builds_it(_):
    path = workspace("ws_tools")
    run(["catkin", "config", "--cmake-args"] + CMAKE, path)
    run(["catkin", "build", "--no-status", "--summarize"], path)
    works(path + "/devel/setup.bash")


@case
def catkin_make_isolated_installs_it(_):
    path = workspace("ws_isolated")
    run(["catkin_make_isolated", "--install"] + CMAKE, path)
    works(path + "/install_isolated/setup.bash")


if __name__ == "__main__":
    sys.exit(group.run(node=False) > 0)
