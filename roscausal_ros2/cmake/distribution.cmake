# The feature of roscausal_ros2 for the ROS 2 of this shell (src/distribution.rs), in ROSCAUSAL_DISTRIBUTION.
if("$ENV{ROS_DISTRO}" MATCHES "^(foxy|galactic|humble)$")
  set(ROSCAUSAL_DISTRIBUTION humble)
else()
  set(ROSCAUSAL_DISTRIBUTION jazzy)
endif()
