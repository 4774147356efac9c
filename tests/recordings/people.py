"""Two people and a robot, seen by trackers of many types, as a ROS 1 bag and an MCAP with equal places: people.py PREFIX [SECONDS]

Beside them small MCAPs of what goes wrong: PREFIX_late (who is tracked is told from the third second on), PREFIX_bodies (only bodies are
tracked, and frames of persons stray about), PREFIX_renamed (a tracker loses one for 0.8 s and then calls them by another number).

One topic for each type, with what real trackers do: another order in each message, things that are not people, an empty list, and a
camera that turns with the robot. The texts of the types are those of their packages.
"""

import math
import sys
from pathlib import Path

import numpy as np
from rosbags.rosbag1 import Writer as BagWriter
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer as Ros2Writer
from rosbags.typesys import get_types_from_msg

from write import BEGIN, store

HEADER = "std_msgs/Header header\n"
TYPES = {
    "vision_msgs/ObjectHypothesis": "string class_id\nfloat64 score\n",
    "vision_msgs/ObjectHypothesisWithPose": "vision_msgs/ObjectHypothesis hypothesis\ngeometry_msgs/PoseWithCovariance pose\n",
    "vision_msgs/BoundingBox3D": "geometry_msgs/Pose center\ngeometry_msgs/Vector3 size\n",
    "vision_msgs/Detection3D": HEADER
    + "vision_msgs/ObjectHypothesisWithPose[] results\nvision_msgs/BoundingBox3D bbox\nstring id\n",
    "vision_msgs/Detection3DArray": HEADER + "vision_msgs/Detection3D[] detections\n",
    "zed_msgs/Object": "string label\nint16 label_id\nstring sublabel\nfloat32 confidence\nfloat32[3] position\n"
    "float32[6] position_covariance\nfloat32[3] velocity\nbool tracking_available\nint8 tracking_state\nint8 action_state\n",
    "zed_msgs/ObjectsStamped": HEADER + "zed_msgs/Object[] objects\n",
    "hri_msgs/IdsList": HEADER + "string[] ids\n",
    "hri_msgs/EngagementLevel": HEADER
    + "uint8 UNKNOWN=0\nuint8 DISENGAGED=1\nuint8 ENGAGING=2\nuint8 ENGAGED=3\nuint8 DISENGAGING=4\nuint8 level\n",
    "hri_msgs/Gaze": HEADER + "string sender\nstring receiver\n",
    "leg_tracker/Person": "geometry_msgs/Pose pose\nuint32 id\n",
    "leg_tracker/PersonArray": HEADER + "leg_tracker/Person[] people\n",
    "people_msgs/PositionMeasurement": HEADER
    + "string name\nstring object_id\ngeometry_msgs/Point pos\nfloat64 reliability\nfloat64[9] covariance\nbyte initialization\n",
    "people_msgs/PositionMeasurementArray": HEADER + "people_msgs/PositionMeasurement[] people\nfloat32[] cooccurrence\n",
    "hunav_msgs/Agent": "uint8 PERSON=1\nuint8 ROBOT=2\nint32 id\nuint8 type\nuint8 skin\nuint8 behavior\nstring name\n"
    "uint8 behavior_state\nint8 group_id\ngeometry_msgs/Pose position\nfloat32 yaw\ngeometry_msgs/Twist velocity\n"
    "float32 desired_velocity\nfloat32 radius\nfloat32 linear_vel\nfloat32 angular_vel\ngeometry_msgs/Pose[] goals\n"
    "bool cyclic_goals\nfloat32 goal_radius\ngeometry_msgs/Point[] closest_obs\n",
    "hunav_msgs/Agents": HEADER + "hunav_msgs/Agent[] agents\n",
    "derived_object_msgs/Object": HEADER
    + "uint32 id\nuint8 detection_level\nbool object_classified\ngeometry_msgs/Pose pose\ngeometry_msgs/Twist twist\n"
    "geometry_msgs/Accel accel\ngeometry_msgs/Polygon polygon\nshape_msgs/SolidPrimitive shape\nuint8 classification\n"
    "uint8 classification_certainty\nuint32 classification_age\n",
    "derived_object_msgs/ObjectArray": HEADER + "derived_object_msgs/Object[] objects\n",
    "nav2_dynamic_msgs/Uuid": "uint8[16] uuid\n",
    "nav2_dynamic_msgs/Obstacle": "nav2_dynamic_msgs/Uuid uuid\nfloat32 score\ngeometry_msgs/Point position\n"
    "geometry_msgs/Vector3 velocity\ngeometry_msgs/Vector3 size\n",
    "nav2_dynamic_msgs/ObstacleArray": HEADER + "nav2_dynamic_msgs/Obstacle[] obstacles\n",
    "nav_2d_msgs/Twist2D": "float64 x\nfloat64 y\nfloat64 theta\n",
    "social_nav_msgs/Place": "float64 x\nfloat64 y\nfloat64 theta\n",
    "social_nav_msgs/Pedestrian": "string identifier\nsocial_nav_msgs/Place pose\nnav_2d_msgs/Twist2D velocity\n",
    "social_nav_msgs/Pedestrians": HEADER + "social_nav_msgs/Pedestrian[] pedestrians\n",
}
STEP = 50_000_000  # robot and frames; people every fourth


class Scene:
    """Messages of one ROS version."""

    def __init__(self, ros):
        self.ros, self.types = ros, store(ros)
        for name, text in TYPES.items():
            package, short = name.split("/")
            if f"{package}/msg/{short}" not in self.types.types:
                self.types.register(get_types_from_msg(text, f"{package}/msg/{short}"))
        self.kinds = self.types.types

    def make(self, name, /, **fields):
        package, short = name.split("/")
        return self.kinds[f"{package}/msg/{short}"](**fields)

    def header(self, nanos, frame):
        stamp = self.make("builtin_interfaces/Time", sec=nanos // 10**9, nanosec=nanos % 10**9)
        return self.make("std_msgs/Header", stamp=stamp, frame_id=frame, **({"seq": 0} if self.ros == 1 else {}))

    def point(self, x, y, z=0.0, kind="Point"):
        return self.make(f"geometry_msgs/{kind}", x=float(x), y=float(y), z=float(z))

    def vector(self, x, y, z=0.0):
        return self.point(x, y, z, "Vector3")

    def turn(self, x=0.0, y=0.0, z=0.0, w=1.0):
        return self.make("geometry_msgs/Quaternion", x=x, y=y, z=z, w=w)

    def pose(self, x, y, z=0.0, turn=None):
        return self.make("geometry_msgs/Pose", position=self.point(x, y, z), orientation=turn or self.turn())

    def twist(self, x, y):
        return self.make("geometry_msgs/Twist", linear=self.vector(x, y), angular=self.vector(0, 0))

    def transform(self, nanos, parent, child, x, y, turn):
        inner = self.make("geometry_msgs/Transform", translation=self.vector(x, y), rotation=turn)
        return self.make(
            "geometry_msgs/TransformStamped", header=self.header(nanos, parent), child_frame_id=child, transform=inner
        )


def robot(t):
    """x, y, yaw."""
    return 0.5 * t, -3.0, 0.3 * math.sin(t)


def people(t):
    """(id, name, x, y, vx, vy) of both."""
    return [(1, "anna", 2.0 + 0.8 * t, 1.0, 0.8, 0.0), (2, "berta", 9.0 - 0.6 * t, -1.0, -0.6, 0.0)]


def optical(t, x, y):
    """A place as the camera's optical frame has it: z forward, x right, y down."""
    rx, ry, yaw = robot(t)
    dx, dy = x - rx, y - ry
    forward = math.cos(yaw) * dx + math.sin(yaw) * dy
    left = -math.sin(yaw) * dx + math.cos(yaw) * dy
    return -left, 0.0, forward


def messages(scene, seconds):
    s, none = scene, np.zeros(36)
    static = [
        s.transform(BEGIN, "map", "odom", 0.0, 0.0, s.turn()),
        s.transform(BEGIN, "base_link", "camera_optical", 0.0, 0.0, s.turn(-0.5, 0.5, -0.5, 0.5)),
    ]
    yield "/tf_static", "tf2_msgs/TFMessage", BEGIN, s.make("tf2_msgs/TFMessage", transforms=static)
    for i in range(int(seconds * 1e9) // STEP):
        nanos, t = BEGIN + i * STEP, i * STEP * 1e-9
        x, y, yaw = robot(t)
        turn = s.turn(z=math.sin(yaw / 2), w=math.cos(yaw / 2))
        frames = [s.transform(nanos, "odom", "base_link", x, y, turn)]
        for _, name, px, py, *_ in people(t):
            frames.append(s.transform(nanos, "odom", f"person_{name}", px, py, s.turn()))
        frames.append(s.transform(nanos, "odom", "person_ghost", 50.0, 50.0, s.turn()))
        yield "/tf", "tf2_msgs/TFMessage", nanos, s.make("tf2_msgs/TFMessage", transforms=frames)
        located = s.make("geometry_msgs/PoseWithCovariance", pose=s.pose(x, y, 0.0, turn), covariance=none)
        yield "/odom", "nav_msgs/Odometry", nanos, s.make(
            "nav_msgs/Odometry",
            header=s.header(nanos, "odom"),
            child_frame_id="base_link",
            pose=located,
            twist=s.make("geometry_msgs/TwistWithCovariance", twist=s.twist(0.5, 0.0), covariance=none),
        )
        if i % 4 == 0:
            yield from seen(s, nanos + 1000, i // 4, nanos, t)


def seen(s, when, i, nanos, t):
    """What each tracker says at this moment; in turn one or the other is first, and once nobody is seen."""
    both = people(t) if i % 2 == 0 else people(t)[::-1]
    if i == 5:
        both = []
    order = both + [(7, "chair", 1.0, 5.0, 0.0, 0.0)]
    head = s.header(nanos, "map")

    def one(topic, kind, /, **fields):
        return topic, kind, when, s.make(kind, header=head, **fields)

    detections = []
    for _, name, x, y, *_ in order:
        place = s.make("geometry_msgs/PoseWithCovariance", pose=s.pose(*optical(t, x, y)), covariance=np.zeros(36))
        hypothesis = s.make("vision_msgs/ObjectHypothesis", class_id="chair" if name == "chair" else "person", score=0.9)
        result = s.make("vision_msgs/ObjectHypothesisWithPose", hypothesis=hypothesis, pose=place)
        box = s.make("vision_msgs/BoundingBox3D", center=place.pose, size=s.vector(0.5, 1.7, 0.5))
        detections.append((head, [result], box, name))
    for topic, named in (("/detections", True), ("/untracked", False)):
        array = [
            s.make(
                "vision_msgs/Detection3D",
                header=s.header(nanos, "camera_optical"),
                results=results,
                bbox=box,
                id=name if named else "",
            )
            for _, results, box, name in detections
        ]
        kind = "vision_msgs/Detection3DArray"
        yield topic, kind, when, s.make(kind, header=s.header(nanos, "camera_optical"), detections=array)
    objects = []
    for number, name, x, y, *_ in order:
        objects.append(
            s.make(
                "zed_msgs/Object",
                label="Chair" if name == "chair" else "Person",
                label_id=number,
                sublabel="",
                confidence=80.0,
                position=np.array(optical(t, x, y), dtype=np.float32),
                position_covariance=np.zeros(6, dtype=np.float32),
                velocity=np.full(3, np.nan, dtype=np.float32),
                tracking_available=True,
                tracking_state=1,
                action_state=2,
            )
        )
    kind = "zed_msgs/ObjectsStamped"
    yield "/zed/objects", kind, when, s.make(kind, header=s.header(nanos, "camera_optical"), objects=objects)
    yield one("/humans/persons/tracked", "hri_msgs/IdsList", ids=["anna", "berta"])
    for number, name, _, _, vx, vy in people(t):
        # REP-155: a person's body and face have ids of their own; one topic of gaze for all.
        yield f"/humans/persons/{name}/body_id", "std_msgs/String", when, s.make("std_msgs/String", data=f"body{number}")
        level = 3 if (i + number) % 4 < 2 else 1
        yield one(f"/humans/persons/{name}/engagement_status", "hri_msgs/EngagementLevel", level=level)
        yield one(f"/humans/bodies/body{number}/velocity", "geometry_msgs/TwistStamped", twist=s.twist(vx, vy))
        looks_at = "robot" if (i + number) % 6 < 3 else "screen"
        yield one("/humans/interactions/gaze", "hri_msgs/Gaze", sender=name, receiver=looks_at)
    yield one(
        "/people_tracked",
        "leg_tracker/PersonArray",
        people=[s.make("leg_tracker/Person", pose=s.pose(x, y), id=number) for number, _, x, y, *_ in both],
    )
    yield one(
        "/leg_measurements",
        "people_msgs/PositionMeasurementArray",
        people=[
            s.make(
                "people_msgs/PositionMeasurement",
                header=head,
                name="leg_detector",
                object_id=f"leg_{number}",
                pos=s.point(x, y),
                reliability=0.8,
                covariance=np.zeros(9),
                initialization=0,
            )
            for number, _, x, y, *_ in both
        ],
        cooccurrence=np.zeros(0, dtype=np.float32),
    )
    yield one(
        "/human_states",
        "hunav_msgs/Agents",
        agents=[
            s.make(
                "hunav_msgs/Agent",
                id=number,
                type=2 if name == "chair" else 1,
                skin=0,
                behavior=1,
                name=name,
                behavior_state=0,
                group_id=-1,
                position=s.pose(x, y),
                yaw=0.0,
                velocity=s.twist(vx, vy),
                desired_velocity=1.0,
                radius=0.4,
                linear_vel=abs(vx),
                angular_vel=0.0,
                goals=[s.pose(12.0, y)],
                cyclic_goals=False,
                goal_radius=0.3,
                closest_obs=[s.point(0, 0)],
            )
            for number, name, x, y, vx, vy in order
        ],
    )
    still = s.make("geometry_msgs/Accel", linear=s.vector(0, 0), angular=s.vector(0, 0))
    solid = {"type": 1, "dimensions": np.array([0.5, 0.5, 1.7])}
    if s.ros == 2:
        solid["polygon"] = s.make("geometry_msgs/Polygon", points=[])
    yield one(
        "/carla/objects",
        "derived_object_msgs/ObjectArray",
        objects=[
            s.make(
                "derived_object_msgs/Object",
                header=head,
                id=number,
                detection_level=1,
                object_classified=True,
                pose=s.pose(x, y),
                twist=s.twist(vx, vy),
                accel=still,
                polygon=s.make("geometry_msgs/Polygon", points=[]),
                shape=s.make("shape_msgs/SolidPrimitive", **solid),
                classification=6 if name == "chair" else 4,
                classification_certainty=255,
                classification_age=i,
            )
            for number, name, x, y, vx, vy in order
        ],
    )
    uuid = {"anna": 17, "berta": 99, "chair": 3}
    yield one(
        "/tracking",
        "nav2_dynamic_msgs/ObstacleArray",
        obstacles=[
            s.make(
                "nav2_dynamic_msgs/Obstacle",
                uuid=s.make("nav2_dynamic_msgs/Uuid", uuid=np.full(16, uuid[name], dtype=np.uint8)),
                score=0.7,
                position=s.point(x, y),
                velocity=s.vector(vx, vy),
                size=s.vector(0.5, 0.5, 1.7),
            )
            for _, name, x, y, vx, vy in both
        ],
    )
    yield one(
        "/pedestrians",
        "social_nav_msgs/Pedestrians",
        pedestrians=[
            s.make(
                "social_nav_msgs/Pedestrian",
                identifier=name,
                pose=s.make("social_nav_msgs/Place", x=x, y=y, theta=0.0),
                velocity=s.make("nav_2d_msgs/Twist2D", x=vx, y=vy, theta=0.0),
            )
            for _, name, x, y, vx, vy in both
        ],
    )
    markers = [marker(s, head, "people", number, x, y) for number, _, x, y, *_ in both]
    markers += [marker(s, head, "walls", number, 0.0, 3.0) for number in (1, 2)]
    yield "/markers", "visualization_msgs/MarkerArray", when, s.make("visualization_msgs/MarkerArray", markers=markers)
    yield one("/poses", "geometry_msgs/PoseArray", poses=[s.pose(x, y) for _, _, x, y, *_ in both])
    for number, _, x, y, *_ in both:
        yield one(f"/person_{number}/pose", "geometry_msgs/PoseStamped", pose=s.pose(x, y))


def marker(s, head, space, number, x, y):
    fields = dict(
        header=head,
        ns=space,
        id=number,
        type=3,
        action=0,
        pose=s.pose(x, y),
        scale=s.vector(0.5, 0.5, 1.7),
        color=s.make("std_msgs/ColorRGBA", r=0.0, g=1.0, b=0.0, a=1.0),
        lifetime=s.make("builtin_interfaces/Duration", sec=0, nanosec=0),
        frame_locked=False,
        points=[],
        colors=[],
        text="",
        mesh_resource="",
        mesh_use_embedded_materials=False,
    )
    if s.ros == 2:
        empty = np.zeros(0, dtype=np.uint8)
        fields.update(
            texture_resource="",
            texture=s.make("sensor_msgs/CompressedImage", header=head, format="", data=empty),
            uv_coordinates=[],
            mesh_file=s.make("visualization_msgs/MeshFile", filename="", data=empty),
        )
    return s.make("visualization_msgs/Marker", **fields)


def late(scene, seconds):
    for topic, kind, time, message in messages(scene, seconds):
        is_list = topic == "/humans/persons/tracked"
        if topic in ("/odom", "/tf", "/tf_static") or (is_list and time >= BEGIN + 2 * 10**9):
            yield topic, kind, time, message


def bodies(scene, seconds):
    s = scene
    for topic, kind, time, message in messages(scene, seconds):
        if topic == "/tf":
            for (*_, x, y, _, _), body in zip(people((time - BEGIN) * 1e-9), ("b17", "b99")):
                message.transforms.append(s.transform(time, "odom", f"body_{body}", x, y, s.turn()))
        if topic in ("/odom", "/tf", "/tf_static"):
            yield topic, kind, time, message
        if topic == "/odom" and (time - BEGIN) % (4 * STEP) == 0:
            ids = s.make("hri_msgs/IdsList", header=s.header(time, "map"), ids=["b17", "b99"])
            yield "/humans/bodies/tracked", "hri_msgs/IdsList", time + 1000, ids


def renamed(scene, seconds):
    for topic, kind, time, message in messages(scene, seconds):
        after = (time - BEGIN) * 1e-9
        if topic == "/people_tracked":
            message.people[:] = [one for one in message.people if one.id == 1 and not 2.0 <= after < 2.8]
            for person in message.people:
                person.id = 1 if after < 2.0 else 77
        if topic in ("/odom", "/tf", "/tf_static", "/people_tracked"):
            yield topic, kind, time, message


def main():
    prefix, seconds = sys.argv[1], float(sys.argv[2]) if len(sys.argv) > 2 else 6.0
    for ros, ending, scenes in (
        (1, ".bag", messages),
        (2, "_mcap", messages),
        (2, "_late", late),
        (2, "_bodies", bodies),
        (2, "_renamed", renamed),
    ):
        scene, connections = Scene(ros), {}
        if ros == 1:
            writer = BagWriter(Path(f"{prefix}{ending}"))
            writer.set_compression(BagWriter.CompressionFormat.BZ2)
        else:
            writer = Ros2Writer(Path(f"{prefix}{ending}"), version=9, storage_plugin=StoragePlugin.MCAP)
            writer.set_compression(CompressionMode.FILE, CompressionFormat.ZSTD)
        with writer:
            for topic, kind, time, message in scenes(scene, seconds):
                kind = kind.replace("/", "/msg/")
                if topic not in connections:
                    connections[topic] = writer.add_connection(topic, kind, typestore=scene.types)
                serialize = scene.types.serialize_ros1 if ros == 1 else scene.types.serialize_cdr
                writer.write(connections[topic], time, serialize(message, kind))


if __name__ == "__main__":
    main()
