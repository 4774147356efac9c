"""Rewrites the bags of write.py with the real rosbag of ROS 1, in each compression: rewrite.py FOLDER"""

import sys
from pathlib import Path

import rosbag


def main():
    folder = Path(sys.argv[1])
    for compression in ("none", "bz2", "lz4"):
        with rosbag.Bag(str(folder / "plain.bag")) as theirs:
            with rosbag.Bag(str(folder / f"real_{compression}.bag"), "w", compression, 8192) as real:
                for topic, message, time, header in theirs.read_messages(raw=True, return_connection_header=True):
                    real.write(topic, message, time, raw=True, connection_header=header)
        with rosbag.Bag(str(folder / f"real_{compression}.bag")) as real:
            print(compression, real.get_message_count(), "messages")


if __name__ == "__main__":
    main()
