"""Writes ROS 2 packages of the foreign messages that the wheels lack: python make_packages.py FOREIGN OUT NAME..."""

import pathlib
import re
import sys

PACKAGE = """<?xml version="1.0"?>
<package format="3">
  <name>{name}</name><version>0.0.1</version><description>For tests</description>
  <maintainer email="maintainers@roscausal.org">ROS-Causal maintainers</maintainer><license>MIT</license>
  <buildtool_depend>ament_cmake</buildtool_depend><buildtool_depend>rosidl_default_generators</buildtool_depend>
  <member_of_group>rosidl_interface_packages</member_of_group>
  <export><build_type>ament_cmake</build_type></export>
</package>
"""
CMAKE = """cmake_minimum_required(VERSION 3.10)
project({name})
find_package(ament_cmake REQUIRED)
find_package(rosidl_default_generators REQUIRED)
foreach(package builtin_interfaces std_msgs geometry_msgs)
  find_package(${{package}} REQUIRED)
endforeach()
rosidl_generate_interfaces({name} {files} DEPENDENCIES builtin_interfaces std_msgs geometry_msgs)
ament_package()
"""


def write(path, text):
    """Writes only if the content changed, so that nothing is rebuilt needlessly."""
    path.parent.mkdir(parents=True, exist_ok=True)
    if not path.exists() or path.read_text() != text:
        path.write_text(text)


foreign, out, *names = sys.argv[1:]
for name in names:
    files = sorted(pathlib.Path(foreign, name, "msg").glob("*.msg"))
    for file in files:
        text = re.sub(r"(?m)^(time|duration)\b", lambda m: f"builtin_interfaces/{m[1].capitalize()}", file.read_text())
        write(pathlib.Path(out, name, "msg", file.name), text)
    write(pathlib.Path(out, name, "package.xml"), PACKAGE.format(name=name))
    listed = " ".join(f"msg/{file.name}" for file in files)
    write(pathlib.Path(out, name, "CMakeLists.txt"), CMAKE.format(name=name, files=listed))
