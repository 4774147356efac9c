"""Writes recordings with other software (rosbags, mcap, mcap-ros1-support, mcap-ros2-support), for our reader: write.py FOLDER MESSAGES"""

import sys
from pathlib import Path

import numpy as np
from mcap.writer import CompressionType, Writer as McapWriter
from mcap_ros1._vendor.genpy.dynamic import generate_dynamic
from mcap_ros1.writer import Writer as Ros1SupportWriter
from mcap_ros2.writer import Writer as Ros2SupportWriter
from rosbags.interfaces import Qos, QosDurability, QosHistory, QosLiveliness, QosReliability, QosTime
from rosbags.rosbag1 import Writer as BagWriter
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer as Ros2Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

MESSAGES = Path(__file__).parents[2] / "roscausal_msgs/foreign"
BEGIN = 1_700_000_000_000_000_000
FOREIGN = ["people_msgs/Person", "people_msgs/People", "tf2_msgs/TFMessage"]
ODD = "int32 number\nfloat64[] values\n"


def store(ros):
    types = get_typestore(Stores.ROS1_NOETIC if ros == 1 else Stores.ROS2_JAZZY)
    for name in FOREIGN:
        package, short = name.split("/")
        if f"{package}/msg/{short}" not in types.types:
            text = (MESSAGES / package / "msg" / f"{short}.msg").read_text()
            types.register(get_types_from_msg(text, f"{package}/msg/{short}"))
    types.register(get_types_from_msg(ODD, "custom_msgs/msg/Odd"))
    return types


def messages(types, ros, count):
    """(topic, type, recording time, message), not quite in the order of their times."""
    kinds = types.types

    def header(nanos, frame, seq):
        stamp = kinds["builtin_interfaces/msg/Time"](sec=nanos // 10**9, nanosec=nanos % 10**9)
        fields = {"seq": seq} if ros == 1 else {}
        return kinds["std_msgs/msg/Header"](stamp=stamp, frame_id=frame, **fields)

    point, vector = kinds["geometry_msgs/msg/Point"], kinds["geometry_msgs/msg/Vector3"]
    quaternion = kinds["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0)
    pose, covariance = kinds["geometry_msgs/msg/Pose"], np.zeros(36)
    transform = kinds["geometry_msgs/msg/TransformStamped"](
        header=header(BEGIN, "map", 0),
        child_frame_id="odom",
        transform=kinds["geometry_msgs/msg/Transform"](
            translation=vector(x=1.0, y=2.0, z=0.0), rotation=quaternion
        ),
    )
    static = kinds["tf2_msgs/msg/TFMessage"](transforms=[transform])
    yield "/tf_static", "tf2_msgs/msg/TFMessage", BEGIN, static
    for i in range(count):
        nanos = BEGIN + i * 100_000_000
        odometry = kinds["nav_msgs/msg/Odometry"](
            header=header(nanos, "odom", i),
            child_frame_id="base_footprint",
            pose=kinds["geometry_msgs/msg/PoseWithCovariance"](
                pose=pose(position=point(x=0.5 * i, y=-1.0, z=0.0), orientation=quaternion), covariance=covariance
            ),
            twist=kinds["geometry_msgs/msg/TwistWithCovariance"](
                twist=kinds["geometry_msgs/msg/Twist"](
                    linear=vector(x=0.25, y=0.0, z=0.0), angular=vector(x=0.0, y=0.0, z=0.125)
                ),
                covariance=covariance,
            ),
        )
        yield "/odom", "nav_msgs/msg/Odometry", nanos + 1000, odometry
        if i % 2 == 0:
            person = kinds["people_msgs/msg/Person"](
                name=f"person {i}",
                position=point(x=float(i), y=1.0, z=0.0),
                velocity=point(x=0.0, y=0.0, z=0.0),
                reliability=0.5,
                tagnames=["a", "b"],
                tags=["ä", ""],
            )
            people = kinds["people_msgs/msg/People"](header=header(nanos, "map", i), people=[person] * (i % 3))
            # Recorded before the odometry that precedes it in the file.
            yield "/people", "people_msgs/msg/People", nanos, people
        if i == 3:
            odd = kinds["custom_msgs/msg/Odd"](number=7, values=np.array([1.0]))
            yield "/odd", "custom_msgs/msg/Odd", nanos + 2000, odd


def write_bag(path, count, compression):
    types, connections = store(1), {}
    writer = BagWriter(path)
    if compression:
        writer.set_compression(compression)
    writer.chunk_threshold = 4096
    with writer:
        for topic, kind, time, message in messages(types, 1, count):
            if topic not in connections:
                latching = 1 if topic == "/tf_static" else None
                connections[topic] = writer.add_connection(topic, kind, typestore=types, latching=latching)
            writer.write(connections[topic], time, types.serialize_ros1(message, kind))


def write_ros2(path, count, plugin, packed=None):
    types, connections = store(2), {}
    never = QosTime(sec=2147483647, nsec=4294967295)
    static = Qos(
        history=QosHistory.KEEP_LAST,
        depth=1,
        reliability=QosReliability.RELIABLE,
        durability=QosDurability.TRANSIENT_LOCAL,
        deadline=never,
        lifespan=never,
        liveliness=QosLiveliness.AUTOMATIC,
        liveliness_lease_duration=never,
        avoid_ros_namespace_conventions=False,
    )
    writer = Ros2Writer(path, version=9, storage_plugin=plugin)
    if packed:
        writer.set_compression(packed, CompressionFormat.ZSTD)
    with writer:
        for topic, kind, time, message in messages(types, 2, count):
            if topic not in connections:
                profiles = [static] if topic == "/tf_static" else []
                connections[topic] = writer.add_connection(
                    topic, kind, typestore=types, offered_qos_profiles=profiles
                )
            writer.write(connections[topic], time, types.serialize_cdr(message, kind))


def write_mcap(path, count, ros, **options):
    types, channels = store(ros), {}
    with open(path, "wb") as file:
        writer = McapWriter(file, chunk_size=4096, **options)
        writer.start(profile=f"ros{ros}")
        for number, (topic, kind, time, message) in enumerate(messages(types, ros, count)):
            if topic not in channels:
                text, md5 = types.generate_msgdef(kind, ros_version=ros)
                name = kind.replace("/msg/", "/") if ros == 1 else kind
                schema = writer.register_schema(name, f"ros{ros}msg", text.encode())
                metadata = {"md5sum": md5, "latching": "1" if topic == "/tf_static" else "0"} if ros == 1 else {}
                channels[topic] = writer.register_channel(
                    topic, "ros1" if ros == 1 else "cdr", schema, metadata=metadata
                )
            serialize = types.serialize_ros1 if ros == 1 else types.serialize_cdr
            writer.add_message(channels[topic], time, bytes(serialize(message, kind)), time, number)
        writer.finish()


def write_ros1_support(path, count):
    """Messages that genpy, ROS 1's own library for Python, encodes: those of rosbags, decoded by it."""
    types, kinds = store(1), {}
    with open(path, "wb") as file:
        writer = Ros1SupportWriter(file, chunk_size=4096)
        for number, (topic, kind, time, message) in enumerate(messages(types, 1, count)):
            name = kind.replace("/msg/", "/")
            if name not in kinds:
                kinds[name] = generate_dynamic(name, types.generate_msgdef(kind, ros_version=1)[0])[name]
            own = kinds[name]()
            own.deserialize(bytes(types.serialize_ros1(message, kind)))
            writer.write_message(topic, own, time, time, number)
        writer.finish()


def plain(value):
    """A message of rosbags as the library takes it: dictionaries, lists and numbers."""
    if hasattr(value, "__dataclass_fields__"):
        return {name: plain(getattr(value, name)) for name in value.__dataclass_fields__ if name != "__msgtype__"}
    if isinstance(value, np.ndarray):
        return value.tolist()
    return [plain(one) for one in value] if isinstance(value, list) else value


def write_ros2_support(path, count):
    """Messages that mcap-ros2-support encodes from the definition."""
    types, schemas = store(2), {}
    with open(path, "wb") as file:
        writer = Ros2SupportWriter(file, chunk_size=4096)
        for number, (topic, kind, time, message) in enumerate(messages(types, 2, count)):
            if kind not in schemas:
                schemas[kind] = writer.register_msgdef(kind, types.generate_msgdef(kind, ros_version=2)[0])
            writer.write_message(topic, schemas[kind], plain(message), time, time, number)
        writer.finish()


def main():
    folder, count = Path(sys.argv[1]), int(sys.argv[2])
    folder.mkdir(parents=True, exist_ok=True)
    write_bag(folder / "plain.bag", count, None)
    write_bag(folder / "lz4.bag", count, BagWriter.CompressionFormat.LZ4)
    write_bag(folder / "bz2.bag", count, BagWriter.CompressionFormat.BZ2)
    write_ros2(folder / "ros2_db3", count, StoragePlugin.SQLITE3)
    write_ros2(folder / "ros2_mcap", count, StoragePlugin.MCAP)
    write_ros2(folder / "ros2_db3_by_file", count, StoragePlugin.SQLITE3, CompressionMode.FILE)
    write_ros2(folder / "ros2_mcap_by_file", count, StoragePlugin.MCAP, CompressionMode.FILE)
    write_ros2(folder / "ros2_db3_by_message", count, StoragePlugin.SQLITE3, CompressionMode.MESSAGE)
    write_ros2(folder / "ros2_mcap_by_message", count, StoragePlugin.MCAP, CompressionMode.MESSAGE)
    write_mcap(folder / "ros1_zstd.mcap", count, 1, compression=CompressionType.ZSTD)
    write_mcap(folder / "ros2_lz4.mcap", count, 2, compression=CompressionType.LZ4)
    write_mcap(folder / "ros2_plain.mcap", count, 2, compression=CompressionType.NONE)
    write_mcap(folder / "unchunked.mcap", count, 2, use_chunking=False)
    write_ros1_support(folder / "ros1_support.mcap", count)
    write_ros2_support(folder / "ros2_support.mcap", count)


if __name__ == "__main__":
    main()
