#!/bin/bash
# Our nodes against real ROS 2: rclpy over Fast DDS, colcon, and Cyclone DDS as a second vendor. If no ROS 2
# is installed, a virtual environment with its Python wheels is made below target/ (once, about 500 MB).
#   tests/interop/ros2.sh [PART OF A TEST'S NAME]
# ROSCAUSAL_ROS_DISTRO=kilted tests against another distribution; ROSCAUSAL_PROGRAMS=FOLDER takes the programs that cargo
# has made there (target/debug by `cargo build -p roscausal_ros2 --bins --examples`), instead of building them with colcon.
# All traffic stays on this machine. Exit code 0 only if all passed, 77 if there is no
# ROS 2 and it cannot be installed. The last line is 'N passed, N failed'.
set -u
root=$(cd "$(dirname "$0")/../.." && pwd)
distro=${ROSCAUSAL_ROS_DISTRO:-jazzy}
target=${CARGO_TARGET_DIR:-$root/target}
. "$root/tests/lib.sh"

# What is made once, and the workspaces. They are outside the clone, because ROS 1 takes every program below a package's
# folder for one of that package.
kept=$root/target/interop_ros2/$distro
work=$(mktemp -d -t roscausal-ros2-XXXXXX)
trap 'rm -rf "$work"' EXIT
mkdir -p "$kept"

# the wheels of ROS 2
wheels() {
  local prefix=ros-$distro venv=$kept/venv
  local more=("$prefix-python-cmake-module")
  [ "$distro" = kilted ] && more=(ros-python-cmake-module ros-kilted-ament-cmake-ros-core)
  echo "No ROS 2 here: its wheels go into $venv"
  environment "$venv" "$prefix"-{rclpy,rmw-fastrtps-cpp} \
    "$prefix"-{std,geometry,nav,sensor,diagnostic,visualization,rosgraph}-msgs \
    "$prefix"-rosidl-{default-generators,default-runtime,core-generators} \
    "$prefix"-ament-{cmake,package,cmake-include-directories,cmake-ros,cmake-pytest,cmake-gtest,cmake-gmock} \
    "${more[@]}" colcon-common-extensions cmake cyclonedds
  # The CMake files in the wheels contain the folders of the machine on which they were built.
  local python numpy
  python=$("$venv/bin/python" -c 'import sysconfig; print(sysconfig.get_paths()["include"])')
  numpy=$("$venv/bin/python" -c 'import numpy; print(numpy.get_include())')
  grep -rlE '/opt/python/cp3' "$venv/share" --include='*.cmake' | xargs -r sed -i -E \
    "s#/opt/python/cp3[0-9]+-cp3[0-9]+/lib/python3\.[0-9]+/site-packages/numpy/_core/include#$numpy#g
     s#/opt/python/cp3[0-9]+-cp3[0-9]+/include/python3\.[0-9]+#$python#g"
  set +u
  . "$venv/bin/activate"
  set -u
  export ROS_VERSION=2 ROS_DISTRO=$distro ROS_PYTHON_VERSION=3
  export AMENT_PREFIX_PATH=$venv CMAKE_PREFIX_PATH=$venv
}
if [ "${ROS_VERSION:-}" = 2 ] && python3 -c 'import rclpy' 2>/dev/null && command -v colcon >/dev/null; then
  echo "Testing against the ROS 2 of this shell: ${ROS_DISTRO:-unknown}"
else
  wheels
fi
export RMW_IMPLEMENTATION=rmw_fastrtps_cpp
export ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST ROS_DOMAIN_ID=$((10 + $$ % 80))
unset ROS_LOCALHOST_ONLY

build() { # workspace, then colcon's arguments; the log is shown only when it fails
  local folder=$1
  shift
  echo "building ${folder##*/} ..."
  (cd "$folder" && colcon --log-base log build --event-handlers console_stderr- "$@") >"$folder.log" 2>&1 || {
    tail -50 "$folder.log"
    broken "colcon did not build ${folder##*/}"
  }
}

use() { # the packages of one workspace
  set +u
  . "$1/install/local_setup.bash"
  set -u
}

# foreign messages that the wheels lack
mkdir -p "$kept/foreign/src"
python3 "$root/tests/interop/ros2/make_packages.py" "$root/roscausal_msgs/foreign" "$kept/foreign/src" \
  nav2_msgs tf2_msgs people_msgs pedsim_msgs spencer_tracking_msgs
stamp=$(find "$kept/foreign/src" -type f -exec cksum {} + | sort | cksum)
if [ "$stamp" != "$(cat "$kept/foreign/built" 2>/dev/null)" ]; then
  build "$kept/foreign"
  echo "$stamp" >"$kept/foreign/built"
fi
use "$kept/foreign"
# rosrust reads message definitions from where the shell says, and must compile in a ROS 2 shell as well.
(cd "$root" && CARGO_TARGET_DIR=$kept/cargo cargo check --locked -p rosrust) >"$kept/cargo.log" 2>&1 ||
  { tail -40 "$kept/cargo.log"; broken "rosrust does not compile in a shell of ROS 2"; }
prepare_only "$@"

if [ -z "${ROSCAUSAL_PROGRAMS:-}" ]; then
  # this repository in a workspace: messages and nodes in one build
  mkdir -p "$work/ws/src"
  ln -s "$root" "$work/ws/src/roscausal"
  build "$work/ws" --cmake-args "-DROSCAUSAL_PROFILE=$profile" "-DROSCAUSAL_CARGO_TARGET_DIR=$target"
  use "$work/ws"
  (cd "$root" && CARGO_TARGET_DIR=$target build_all) >"$work/cargo.log" 2>&1 ||
    { tail -40 "$work/cargo.log"; broken "cargo does not build the workspace in a shell of ROS 2"; }
  export ROSCAUSAL_BIN=$work/ws/install/roscausal/lib/roscausal ROSCAUSAL_PEER=$target/$profile/examples/ros2_peer
  export ROSCAUSAL_INSTALL=$work/ws/install
else
  mkdir -p "$work/messages"
  build "$work/messages" --base-paths "$root/roscausal_msgs"
  use "$work/messages"
  export ROSCAUSAL_BIN=$ROSCAUSAL_PROGRAMS ROSCAUSAL_PEER=$ROSCAUSAL_PROGRAMS/examples/ros2_peer
fi

export ROSCAUSAL_ROOT=$root ROSCAUSAL_FASTDDS_PROFILE=$root/tests/interop/ros2/fastdds_large.xml
cd "$root/tests/interop/ros2" && PYTHONDONTWRITEBYTECODE=1 python3 run.py "$@"
