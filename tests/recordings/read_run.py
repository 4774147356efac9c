"""Reads the recording of a run with mcap and rosbags, every message of every topic: read_run.py FILE MODEL.json"""

import json
import sys

from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

NEEDED = {
    "/mobile_base_controller/odom": 1500,
    "/ped/control/teleop_persons": 1500,
    "/roscausal/robot": 1400,
    "/roscausal/humans": 550,
    "/roscausal/causal_model": 1,
    "/roscausal/causal_model_info": 1,
    "/roscausal/dag": 1,
    "/roscausal/tsdag/compressed": 1,
    "/diagnostics": 60,
}


def main():
    path, model = sys.argv[1], json.load(open(sys.argv[2]))
    types, counts = get_typestore(Stores.ROS2_JAZZY), {}
    with open(path, "rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        for schema, channel, record, message in reader.iter_decoded_messages():
            counts[channel.topic] = counts.get(channel.topic, 0) + 1
            if schema.name not in types.types:
                found = get_types_from_msg(schema.data.decode(), schema.name)
                types.register({name: kind for name, kind in found.items() if name not in types.types})
            other = types.deserialize_cdr(record.data, schema.name)
            if channel.topic == "/roscausal/causal_model":
                assert list(message.features) == list(other.features) == model["features"], message.features
                flat = [v for lag in model["causal_structure"] for row in lag for v in row]
                assert list(message.causal_structure.data) == list(other.causal_structure.data) == flat
            if channel.topic == "/roscausal/dag":
                assert len(message.data) == message.height * message.step == len(other.data)
            if channel.topic == "/roscausal/tsdag/compressed":
                assert bytes(message.data[:8]) == b"\x89PNG\r\n\x1a\n", message.format
            if channel.topic == "/roscausal/robot":
                assert message.pose2d.x == other.pose2d.x
    for topic, least in NEEDED.items():
        assert counts.get(topic, 0) >= least, (topic, counts)
    print(sum(counts.values()), "messages of", len(counts), "topics")


if __name__ == "__main__":
    main()
