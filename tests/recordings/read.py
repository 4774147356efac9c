"""Uses other software (mcap, rosbags) to read what we wrote: read.py FILE"""

import sys
from pathlib import Path

from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

EXPECTED = {
    "/roscausal/humans": ("roscausal_msgs/msg/Humans", 50),
    "/roscausal/causal_model": ("roscausal_msgs/msg/CausalModel", 1),
    "/roscausal/dag": ("sensor_msgs/msg/Image", 1),
    "/roscausal/markers": ("visualization_msgs/msg/MarkerArray", 1),
}


def check(topic, number, message):
    if topic == "/roscausal/humans":
        assert len(message.humans) == number % 3, (number, message)
        for human in message.humans:
            assert (human.id, human.pose2d.x, human.pose2d.y) == (1000, float(number), -0.5), human
            assert human.header.frame_id == "map" and human.goal.x == 3.0, human
    elif topic == "/roscausal/causal_model":
        assert list(message.features) == ["h_v", "h_dg"], message
        assert list(message.causal_structure.data) == [0, 1, 1, 0], message
        assert list(message.val_matrix.data) == [0.0, 0.5, -0.25, 0.0], message
    elif topic == "/roscausal/dag":
        assert (message.height, message.width, bytes(message.data)) == (2, 3, bytes(range(18))), message
    else:
        assert [marker.text for marker in message.markers] == ["1000"], message


def by_mcap(path):
    counts = {}
    with open(path, "rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        summary = reader.get_summary()
        assert reader.get_header().profile == "ros2"
        topics = {channel.topic: summary.schemas[channel.schema_id] for channel in summary.channels.values()}
        assert {topic: schema.name for topic, schema in topics.items()} == {
            topic: kind for topic, (kind, _) in EXPECTED.items()
        }
        for _, channel, record, message in reader.iter_decoded_messages():
            number = counts.get(channel.topic, 0)
            assert record.sequence == number
            check(channel.topic, number, message)
            counts[channel.topic] = number + 1
    assert counts == {topic: count for topic, (_, count) in EXPECTED.items()}, counts
    return topics


def by_rosbags(path, topics):
    """Checks that the texts of the types are complete, and agree with those that rosbags has."""
    types = get_typestore(Stores.ROS2_JAZZY)
    for schema in topics.values():
        if schema.name not in types.types:
            found = get_types_from_msg(schema.data.decode(), schema.name)
            types.register({name: kind for name, kind in found.items() if name not in types.types})
    counts = {}
    with open(path, "rb") as file:
        for schema, channel, record in make_reader(file).iter_messages():
            number = counts.get(channel.topic, 0)
            check(channel.topic, number, types.deserialize_cdr(record.data, schema.name))
            counts[channel.topic] = number + 1
    assert sum(counts.values()) == sum(count for _, count in EXPECTED.values())


def main():
    path = Path(sys.argv[1])
    by_rosbags(path, by_mcap(path))
    print(f"{path.name}: read back by mcap and rosbags with equal contents")


if __name__ == "__main__":
    main()
