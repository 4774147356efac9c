"""Two minutes of a robot and a person, as a ROS 1 bag, an MCAP and a db3 with equal messages: walk.py PREFIX"""

import math
import random
import sys
from pathlib import Path

import numpy as np
from rosbags.rosbag1 import Writer as BagWriter
from rosbags.rosbag2 import StoragePlugin, Writer as Ros2Writer

from write import BEGIN, store

STEP = 40_000_000  # 25 Hz
COUNT = 3000


def messages(types, ros):
    kinds, rng = types.types, random.Random(1)
    point, vector = kinds["geometry_msgs/msg/Point"], kinds["geometry_msgs/msg/Vector3"]
    quaternion, covariance = kinds["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0), np.zeros(36)

    def header(nanos, frame):
        stamp = kinds["builtin_interfaces/msg/Time"](sec=nanos // 10**9, nanosec=nanos % 10**9)
        return kinds["std_msgs/msg/Header"](stamp=stamp, frame_id=frame, **({"seq": 0} if ros == 1 else {}))

    def pose(x, y):
        inner = kinds["geometry_msgs/msg/Pose"](position=point(x=x, y=y, z=0.0), orientation=quaternion)
        return kinds["geometry_msgs/msg/PoseWithCovariance"](pose=inner, covariance=covariance)

    x, v = 0.0, 0.5
    for i in range(COUNT):
        nanos, t = BEGIN + i * STEP, i * STEP * 1e-9
        v += 0.3 * (0.8 - v) * 0.04 + rng.gauss(0.0, 0.06)
        x += v * 0.04
        place = 3.0 * math.sin(0.2 * t)
        twist = kinds["geometry_msgs/msg/Twist"](
            linear=vector(x=0.6 * math.cos(0.2 * t), y=0.0, z=0.0), angular=vector(x=0.0, y=0.0, z=0.0)
        )
        yield "/odom", "nav_msgs/msg/Odometry", nanos, kinds["nav_msgs/msg/Odometry"](
            header=header(nanos, "odom"),
            child_frame_id="base_footprint",
            pose=pose(place, 0.0),
            twist=kinds["geometry_msgs/msg/TwistWithCovariance"](twist=twist, covariance=covariance),
        )
        located = kinds["geometry_msgs/msg/PoseWithCovarianceStamped"]
        yield "/amcl_pose", "geometry_msgs/msg/PoseWithCovarianceStamped", nanos + 1000, located(
            header=header(nanos, "map"), pose=pose(place, 0.0)
        )
        person = kinds["people_msgs/msg/Person"](
            name="7",
            position=point(x=x % 8.0 - 4.0, y=1.0, z=0.0),
            velocity=point(x=v, y=0.0, z=0.0),
            reliability=1.0,
            tagnames=[],
            tags=[],
        )
        yield "/people", "people_msgs/msg/People", nanos + 2000, kinds["people_msgs/msg/People"](
            header=header(nanos, "map"), people=[person]
        )
        if i % 25 == 0:
            goal = kinds["geometry_msgs/msg/Pose"](position=point(x=4.0, y=1.0, z=0.0), orientation=quaternion)
            yield "/hri/human_goal", "geometry_msgs/msg/PoseStamped", nanos + 3000, kinds[
                "geometry_msgs/msg/PoseStamped"
            ](header=header(nanos, "map"), pose=goal)


def main():
    prefix = sys.argv[1]
    types, connections = store(1), {}
    with BagWriter(Path(f"{prefix}.bag")) as writer:
        for topic, kind, time, message in messages(types, 1):
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=types)
            writer.write(connections[topic], time, types.serialize_ros1(message, kind))
    for ending, plugin in (("mcap", StoragePlugin.MCAP), ("db3", StoragePlugin.SQLITE3)):
        types, connections = store(2), {}
        with Ros2Writer(Path(f"{prefix}_{ending}"), version=9, storage_plugin=plugin) as writer:
            for topic, kind, time, message in messages(types, 2):
                if topic not in connections:
                    connections[topic] = writer.add_connection(topic, kind, typestore=types)
                writer.write(connections[topic], time, types.serialize_cdr(message, kind))


if __name__ == "__main__":
    main()
