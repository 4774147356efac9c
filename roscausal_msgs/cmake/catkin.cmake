# ROS 1: the .msg and .srv files as they are.
find_package(catkin REQUIRED COMPONENTS message_generation std_msgs geometry_msgs)

add_message_files(DIRECTORY msg FILES ${ROSCAUSAL_MSG_FILES})
add_service_files(DIRECTORY srv FILES ${ROSCAUSAL_SRV_FILES})
generate_messages(DEPENDENCIES std_msgs geometry_msgs)
catkin_package(CATKIN_DEPENDS message_runtime std_msgs geometry_msgs)

# rosmsg searches ROS_PACKAGE_PATH and, like catkin, stops at the package around this folder. So this folder is named.
catkin_add_env_hooks(50.roscausal_msgs SHELLS sh DIRECTORY "${CMAKE_CURRENT_SOURCE_DIR}/cmake" SKIP_INSTALL)
