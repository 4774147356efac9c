"""Reads a ROS 2 XML launch file and returns the command lines that `ros2 launch` would run. `ros2 launch` itself
is in no package registry; what is not understood here is an error, so that the files stay within what was
checked against launch_xml's documentation."""

import os
import re
import tempfile
import xml.etree.ElementTree as xml

ATTRIBUTES = {
    "launch": set(),
    "arg": {"name", "default", "description", "value"},
    "node": {"pkg", "exec", "name", "namespace", "output", "args", "respawn", "respawn_delay", "if"},
    "param": {"from", "name", "value"},
    "remap": {"from", "to"},
    "include": {"file"},
}


def commands(install, package, file, arguments):
    """[(executable, [argument...])] of all nodes; `install` is a colcon install folder."""
    share = os.path.join(install, package, "share", package)
    found = []
    _read(install, os.path.join(share, "launch", file), dict(arguments), found)
    return found


def _read(install, path, variables, found):
    declared = set()

    def text(value):
        def substitute(match):
            kind, _, rest = match[1].partition(" ")
            if kind == "var":
                return variables[rest]
            if kind == "find-pkg-share":
                share = os.path.join(install, rest, "share", rest)
                # like ament_index, which finds a package by its marker
                marker = os.path.join(install, rest, "share/ament_index/resource_index/packages", rest)
                assert os.path.exists(marker), f"{rest} is not in the ament index: no {marker}"
                return share
            if kind == "env":
                name, _, default = rest.partition(" ")
                return os.environ.get(name, default)
            raise ValueError(f"{path}: unknown substitution {match[0]}")

        return re.sub(r"\$\(([^()]*)\)", substitute, value)

    root = xml.parse(path).getroot()
    assert root.tag == "launch", f"{path}: the root is <{root.tag}>"
    for element in [root, *root.iter()]:
        extra = set(element.attrib) - ATTRIBUTES[element.tag]
        assert not extra, f"{path}: <{element.tag}> has no {extra}"
    for element in root:
        if element.tag == "arg":
            declared.add(element.get("name"))
            variables.setdefault(element.get("name"), text(element.get("default", "")))
        elif element.tag == "include":
            inner = {arg.get("name"): text(arg.get("value")) for arg in element}
            _read(install, text(element.get("file")), inner, found)
        elif element.tag == "node":
            wanted = text(element.get("if", "true"))
            assert wanted in ("true", "false"), f"{path}: if={wanted!r}"
            if wanted == "false":
                continue
            found.append(_node(install, element, text))
        else:
            raise ValueError(f"{path}: <{element.tag}> is not understood here")
    unknown = set(variables) - declared
    assert not unknown, f"{path}: no argument {unknown}"


def _node(install, element, text):
    package, executable = element.get("pkg"), element.get("exec")
    path = os.path.join(install, package, "lib", package, executable)
    assert os.access(path, os.X_OK), f"ros2 run would not find {path}"
    name, namespace = text(element.get("name")), text(element.get("namespace", ""))
    # launch_ros gives the user's arguments first, then its own --ros-args
    arguments = text(element.get("args", "")).split()
    arguments += ["--ros-args", "-r", f"__node:={name}"]
    if namespace:
        arguments += ["-r", f"__ns:=/{namespace.strip('/')}"]
    full_name = "/".join(["", *[part for part in [namespace.strip("/")] if part], name])
    for child in element:
        if child.tag == "remap":
            arguments += ["-r", f"{text(child.get('from'))}:={text(child.get('to'))}"]
        elif child.get("from"):
            arguments += ["--params-file", text(child.get("from"))]
        else:
            # launch_ros writes single parameters into a file under the node's full name
            file = tempfile.NamedTemporaryFile("w", suffix=".yaml", prefix="launch_params_", delete=False)
            file.write(f"{full_name}:\n  ros__parameters:\n    {child.get('name')}: {text(child.get('value'))}\n")
            file.close()
            arguments += ["--params-file", file.name]
    return path, arguments
