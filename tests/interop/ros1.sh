#!/bin/bash
# Tests against a real ROS 1: roscore, rospy, roslaunch, rosbag, catkin. Ends with 'N passed, N failed'; exit 0 only
# if all passed. Without ROS 1 it installs Debian's packages, if it runs as root on Debian.
#   tests/interop/ros1.sh [GROUP...]        groups: wire life restart clock conformance nodes fleet reasoning original pipeline packages,
#                                           and figures (five minutes), which needs an otherwise idle machine
# Each group has a master on its own port of 127.0.0.1. Only processes that were started here are ended.
set -u
here=$(cd "$(dirname "$0")" && pwd)
root=$(cd "$here/../.." && pwd)
target=${CARGO_TARGET_DIR:-$root/target}
groups=${*:-wire life restart clock conformance nodes fleet reasoning original pipeline packages}

# Debian's ROS needs Debian's Python
cargo=$(command -v cargo || echo "$HOME/.cargo/bin/cargo")
export PATH="/usr/bin:$(dirname "$cargo"):$PATH"
unset PYTHONPATH PYTHONHOME ROS_HOSTNAME ROS_NAMESPACE ROS_VERSION ROS_DISTRO ROS_PACKAGE_PATH CMAKE_PREFIX_PATH \
  AMENT_PREFIX_PATH COLCON_PREFIX_PATH
export PYTHONDONTWRITEBYTECODE=1

. "$root/tests/lib.sh"
debian_missing "${debian_catkin[@]}" catkin-tools python3-rosmaster python3-roslaunch rosout rosbash python3-rospy python3-rostopic \
  python3-rosparam python3-rosnode python3-rosbag python3-rosmsg python3-rosservice python3-nav-msgs python3-sensor-msgs \
  python3-tf2-ros python3-move-base-msgs python3-visualization-msgs ros-nav-msgs ros-sensor-msgs ros-tf2-msgs ros-rosgraph-msgs \
  ros-move-base-msgs python3-dynamic-reconfigure
prepare_only "$@"

work=$(mktemp -d -t roscausal-ros1-XXXXXX)
trap 'rm -rf "$work"' EXIT

echo "building the nodes ..."
(cd "$root" && build_all) >"$work/cargo.log" 2>&1 || { tail -40 "$work/cargo.log"; broken "cargo could not build the nodes"; }
conformance=$(sed -n 's|^ *Executable tests/ros1_conformance.rs (\(.*\))$|\1|p' "$work/cargo.log")
case $conformance in /*) ;; *) conformance=$root/$conformance ;; esac
export ROSCAUSAL_PEER=$target/$profile/examples/ros1_peer ROSCAUSAL_NODE=$target/$profile/roscausal_ros1 ROSCAUSAL_CONFORMANCE=$conformance

# A catkin workspace with this clone, and pedsim's messages, which Debian lacks.
echo "building the catkin workspace ..."
ws=$work/ws
mkdir -p "$ws/src/pedsim_msgs"
ln -s "$root" "$ws/src/roscausal"
cp -r "$root/roscausal_msgs/foreign/pedsim_msgs/msg" "$ws/src/pedsim_msgs"
cp "$here/ros1/pedsim_msgs.cmake" "$ws/src/pedsim_msgs/CMakeLists.txt"
cp "$here/ros1/pedsim_msgs.xml" "$ws/src/pedsim_msgs/package.xml"
(cd "$ws" && catkin_make -DPYTHON_EXECUTABLE=/usr/bin/python3 -DROSCAUSAL_PROFILE="$profile" \
  -DROSCAUSAL_CARGO_TARGET_DIR="$target") >"$work/catkin.log" 2>&1 ||
  { tail -40 "$work/catkin.log"; broken "catkin_make failed"; }
export ROSCAUSAL_TEST_WS=$ws ROSCAUSAL_ROOT=$root ROSCAUSAL_TARGET=$target ROSCAUSAL_PROFILE=$profile \
  ROSCAUSAL_WORK=$work
# catkin's own scripts use unset variables
set +u
. "$ws/devel/setup.bash"
set -u

: >"$work/results"
for group in $groups; do
  echo "== $group"
  timeout -k 30 1500 /usr/bin/python3 "$here/ros1/$group.py" 2>"$work/$group.err" | tee -a "$work/results"
  code=${PIPESTATUS[0]}
  # a group that failed without printing a line
  if [ "$code" -ne 0 ] && { [ "$code" -ne 1 ] || ! tail -50 "$work/results" | grep -q '^FAIL'; }; then
    tail -20 "$work/$group.err"
    echo "FAIL $group: ended with code $code" | tee -a "$work/results"
  fi
done
passed=$(grep -c '^ok ' "$work/results")
failed=$(grep -c '^FAIL ' "$work/results")
echo "$passed passed, $failed failed"
[ "$failed" -eq 0 ] && [ "$passed" -gt 0 ]
