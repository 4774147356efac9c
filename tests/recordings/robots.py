"""20 s of a robot that drives past two people, as other software's robots record themselves: robots.py PREFIX

PREFIX_amcl.bag: odometry, TF, and AMCL, which finds the robot every 0.6 s with a pause of 9 s, and its particles. PREFIX_oldtf.bag: TF
alone, of the older type tf/tfMessage. PREFIX_frames: TF alone, ROS 2. PREFIX_nav2: a robot in the namespace tb3_0 under Nav2, with plan,
stamped commands and the feedback of the action navigate_to_pose, which comes without a definition: no .msg file has it. PREFIX_fleet:
two robots in the namespaces tb3_0 and tb3_1, 2.5 m apart, with goals and a localisation, on one topic of transforms; PREFIX_crowd: the
same two, of which TF alone tells.
"""

import math
import random
import sys
from pathlib import Path

import numpy as np
from rosbags.rosbag1 import Writer as BagWriter
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer as Ros2Writer
from rosbags.typesys import get_types_from_msg

from people import Scene
from write import BEGIN

STEP = 50_000_000  # 20 Hz
COUNT = 400
FEEDBACK = (
    "geometry_msgs/PoseStamped current_pose\nbuiltin_interfaces/Duration navigation_time\n"
    "builtin_interfaces/Duration estimated_time_remaining\nint16 number_of_recoveries\nfloat32 distance_remaining\n"
)
OLD_TF, ACTION = "tf/msg/tfMessage", "nav2_msgs/msg/NavigateToPose_"


def ride():
    """time, x, y, speed and command of the robot: it follows commands, which change by chance, a little later."""
    rng, x, v, command = random.Random(4), 0.0, 0.5, 0.5
    for i in range(COUNT):
        t = i * STEP * 1e-9
        command = 0.5 + 0.9 * (command - 0.5) + rng.gauss(0.0, 0.05)
        yield i, BEGIN + i * STEP, t, x, 0.1 * math.sin(1.7 * t), v, command
        v += 0.4 * (command - v) + rng.gauss(0.0, 0.01)
        x += v * STEP * 1e-9


def messages(s):
    """All topics of a robot without a namespace."""
    for i, nanos, t, x, y, v, _ in ride():
        frames = [s.transform(nanos, "map", "odom", 0.0, 0.0, s.turn()), s.transform(nanos, "odom", "base_link", x, y, s.turn())]
        yield "/tf", "tf2_msgs/TFMessage", nanos, s.make("tf2_msgs/TFMessage", transforms=frames)
        place = s.make("geometry_msgs/PoseWithCovariance", pose=s.pose(x, y), covariance=np.zeros(36))
        twist = s.make("geometry_msgs/TwistWithCovariance", twist=s.twist(v, 0.0), covariance=np.zeros(36))
        head = s.header(nanos, "odom")
        odometry = s.make("nav_msgs/Odometry", header=head, child_frame_id="base_link", pose=place, twist=twist)
        yield "/odom", "nav_msgs/Odometry", nanos, odometry
        head = s.header(nanos, "map")
        if i % 12 == 0 and not 6 <= t < 15:
            kind = "geometry_msgs/PoseWithCovarianceStamped"
            yield "/amcl_pose", kind, nanos, s.make(kind, header=head, pose=place)
        both = [
            s.pose(2.0 + math.sin(0.8 * t) + 0.2 * math.sin(5.1 * t), 1.0),
            s.pose(4.0, 6.0 + math.cos(0.5 * t) + 0.2 * math.sin(3.3 * t)),
        ]
        kind = "geometry_msgs/PoseArray"
        yield "/people", kind, nanos, s.make(kind, header=head, poses=both[::-1] if i % 7 < 3 else both)
        yield "/particlecloud", kind, nanos, s.make(kind, header=head, poses=[s.pose(x, y)] * 5)


def of_nav2(s):
    s.types.register(get_types_from_msg("uint8[16] uuid\n", "unique_identifier_msgs/msg/UUID"))
    s.types.register(get_types_from_msg(FEEDBACK, ACTION + "Feedback"))
    feedback_message = f"unique_identifier_msgs/UUID goal_id\n{ACTION}Feedback feedback\n"
    s.types.register(get_types_from_msg(feedback_message, ACTION + "FeedbackMessage"))
    kept = {"/tf": "/tb3_0/tf", "/odom": "/tb3_0/odom", "/people": "/people"}
    for topic, kind, nanos, message in messages(s):
        if topic in kept:
            yield kept[topic], kind, nanos, message
    for i, nanos, t, x, y, v, command in ride():
        head, duration = s.header(nanos, "map"), s.make("builtin_interfaces/Duration", sec=int(t), nanosec=0)
        here = s.make("geometry_msgs/PoseStamped", header=head, pose=s.pose(x, 0.0))
        goal = s.make("geometry_msgs/PoseStamped", header=head, pose=s.pose(14.0, 0.0))
        yield "/tb3_0/plan", "nav_msgs/Path", nanos, s.make("nav_msgs/Path", header=head, poses=[here, goal])
        kind = "geometry_msgs/TwistStamped"
        yield "/tb3_0/cmd_vel", kind, nanos, s.make(kind, header=head, twist=s.twist(command, 0.0))
        feedback = s.kinds[ACTION + "Feedback"](
            current_pose=here,
            navigation_time=duration,
            estimated_time_remaining=duration,
            number_of_recoveries=0,
            distance_remaining=14.0 - x,
        )
        uuid = s.make("unique_identifier_msgs/UUID", uuid=np.full(16, 7, dtype=np.uint8))
        whole = s.kinds[ACTION + "FeedbackMessage"](goal_id=uuid, feedback=feedback)
        yield "/tb3_0/navigate_to_pose/_action/feedback", ACTION + "FeedbackMessage", nanos, whole


def of_fleet(s):
    robots = [("tb3_0", 0.0), ("tb3_1", 2.5)]
    for topic, kind, nanos, message in messages(s):
        if topic == "/tf":
            frames = []
            for robot, away in robots:
                for frame in message.transforms:
                    parent, child = frame.header.frame_id, frame.child_frame_id
                    parent, at = (parent, 0.0) if parent == "map" else (f"{robot}/{parent}", away)
                    place = frame.transform.translation
                    frames.append(s.transform(nanos, parent, f"{robot}/{child}", place.x, place.y + at, frame.transform.rotation))
            yield topic, kind, nanos, s.make(kind, transforms=frames)
        elif topic == "/odom":
            for robot, away in robots:
                place = message.pose.pose.position
                pose = s.make("geometry_msgs/PoseWithCovariance", pose=s.pose(place.x, place.y + away), covariance=np.zeros(36))
                own = {"header": s.header(nanos, f"{robot}/odom"), "child_frame_id": f"{robot}/base_link"}
                odometry = s.make(kind, pose=pose, twist=message.twist, **own)
                yield f"/{robot}/odom", kind, nanos, odometry
                yield f"/{robot}/odometry/filtered", kind, nanos, odometry
                goal = s.make("geometry_msgs/PoseStamped", header=s.header(nanos, "map"), pose=s.pose(0.0, 9.0 + away))
                yield f"/{robot}/goal_pose", "geometry_msgs/PoseStamped", nanos, goal
        elif topic == "/people":
            yield topic, kind, nanos, message


def of_crowd(s):
    return (one for one in of_fleet(s) if one[0] in ("/tf", "/people"))


def only(*topics):
    return lambda scene: (one for one in messages(scene) if one[0] in topics)


def old_tf(s):
    s.types.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms\n", OLD_TF))
    for topic, kind, nanos, message in only("/tf", "/people")(s):
        if topic == "/tf":
            kind, message = OLD_TF, s.kinds[OLD_TF](transforms=message.transforms)
        yield topic, kind, nanos, message


def main():
    prefix = sys.argv[1]
    for ros, ending, of in (
        (1, "_amcl.bag", only("/tf", "/odom", "/amcl_pose", "/people", "/particlecloud")),
        (1, "_oldtf.bag", old_tf),
        (2, "_frames", only("/tf", "/people")),
        (2, "_nav2", of_nav2),
        (2, "_fleet", of_fleet),
        (2, "_crowd", of_crowd),
    ):
        scene, connections, path = Scene(ros), {}, Path(f"{prefix}{ending}")
        writer = BagWriter(path) if ros == 1 else Ros2Writer(path, version=9, storage_plugin=StoragePlugin.MCAP)
        if ros == 2:
            writer.set_compression(CompressionMode.FILE, CompressionFormat.ZSTD)
        with writer:
            for topic, kind, time, message in sorted(of(scene), key=lambda one: one[2]):
                if kind.count("/") == 1:
                    kind = kind.replace("/", "/msg/")
                if topic not in connections and kind.startswith(ACTION):
                    named = {"msgdef": " ", "rihs01": "RIHS01_" + 64 * "0"}
                    connections[topic] = writer.add_connection(topic, kind.replace("/msg/", "/action/"), **named)
                elif topic not in connections:
                    connections[topic] = writer.add_connection(topic, kind, typestore=scene.types)
                serialize = scene.types.serialize_ros1 if ros == 1 else scene.types.serialize_cdr
                writer.write(connections[topic], time, serialize(message, kind))


if __name__ == "__main__":
    main()
