"""What a colcon build of a plain clone installs, and where: `ros2 run`, `ros2 launch` and Python must find it."""

import os
import subprocess
import sys
import tempfile

from ament_index_python.packages import get_package_prefix, get_package_share_directory

from harness import INSTALL, test
from launch_reader import commands

NODES = ("robot", "human", "data", "discovery", "hrisim", "dashboard", "markers", "reasoning", "advisor", "watchdog")


@test
def the_nodes_are_where_ros2_run_looks():
    # ros2 run asks the ament index for the prefix, and takes what is executable in lib/PACKAGE.
    prefix = get_package_prefix("roscausal")
    assert prefix == os.path.join(INSTALL, "roscausal"), prefix
    for name in NODES:
        path = os.path.join(prefix, "lib/roscausal", f"roscausal_{name}")
        assert os.access(path, os.X_OK), f"not executable: {path}"
        run = subprocess.run([path, "--ros-args", "-p", "x:="], capture_output=True, text=True, timeout=20)
        assert run.returncode == 2 and "x:=" in run.stderr, run.stderr
        run = subprocess.run([path, "--help"], capture_output=True, text=True, timeout=20)
        assert run.returncode == 0 and "usage" in run.stdout, run.stdout


@test
def the_build_takes_the_layout_of_the_shells_distribution():
    root = os.environ["ROSCAUSAL_ROOT"]
    script = os.path.join(root, "roscausal_ros2/cmake/distribution.cmake")
    for distro, feature in (
        ("humble", "humble"),
        ("galactic", "humble"),
        ("jazzy", "jazzy"),
        ("kilted", "jazzy"),
        ("lyrical", "jazzy"),
        ("rolling", "jazzy"),
    ):
        with tempfile.NamedTemporaryFile("w", suffix=".cmake") as asks:
            asks.write(f'include({script})\nmessage("built for ${{ROSCAUSAL_DISTRIBUTION}}")\n')
            asks.flush()
            env = {**os.environ, "ROS_DISTRO": distro}
            run = subprocess.run(["cmake", "-P", asks.name], env=env, capture_output=True, text=True, timeout=20)
        assert run.returncode == 0 and run.stderr.split()[-1] == feature, (distro, run.stderr)


@test
def the_messages_are_python_modules_with_ros2_names():
    script = (
        "from roscausal_msgs.msg import CausalModel, CausalModelInfo, Humans, HumanState, ModelChanges, RobotState\n"
        "assert 'pose2d' in RobotState.get_fields_and_field_types() and 'pose2d' in HumanState().__slots__[2]\n"
        "print(CausalModel.__module__)"
    )
    run = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=60)
    assert run.returncode == 0, run.stderr
    # From this build, not from an earlier one.
    import roscausal_msgs

    assert roscausal_msgs.__file__.startswith(os.path.join(INSTALL, "roscausal") + os.sep), roscausal_msgs.__file__


@test
def launch_files_name_what_is_installed():
    share = get_package_share_directory("roscausal")
    assert {"hrisim.yaml", "ros2.yaml"} <= set(os.listdir(os.path.join(share, "config")))
    more = {"dashboard": "true", "markers": "true", "reasoning": "true"}
    for file, given, count in (
        ("roscausal.launch.xml", {}, 4),
        ("roscausal.launch.xml", {"reasoning": "true", "advisor": "true"}, 7),
        ("roscausal_hrisim.launch.xml", {}, 5),
        ("roscausal_hrisim.launch.xml", more, 8),
    ):
        assert os.path.exists(os.path.join(share, "launch", file))
        found = commands(INSTALL, "roscausal", file, given)
        assert len(found) == count, found
        for _, arguments in found:
            for flag, value in zip(arguments, arguments[1:]):
                assert flag != "--params-file" or os.path.exists(value), f"{file}: no {value}"
