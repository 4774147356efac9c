# pedsim_ros' messages, for the tests: Debian does not have them.
cmake_minimum_required(VERSION 3.10)
project(pedsim_msgs C CXX)
find_package(catkin REQUIRED COMPONENTS message_generation std_msgs geometry_msgs)
add_message_files(DIRECTORY msg)
generate_messages(DEPENDENCIES std_msgs geometry_msgs)
catkin_package(CATKIN_DEPENDS message_runtime std_msgs geometry_msgs)
