"""Batches of post-processed variables in which the robot is switched off and nobody says so: from batch 8 on their speed no longer
moves the risk. What the discovery node has to tell of them is here, too, for both versions of ROS."""

import os
import random

BATCHES, OFF, ROWS, DT = 12, 8, 300, 0.1
START = 1704067200


def write(folder):
    rng, v, risk = random.Random(7), 0.0, 0.0
    for number in range(BATCHES):
        path = os.path.join(folder, "data_20240101_%06d.csv" % number)
        with open(path + ".tmp", "w") as file:
            file.write("time,h_v,h_dg,h_risk\n")
            for row in range(ROWS):
                risk = (0.8 * v if number < OFF else 0.0) + rng.gauss(0, 0.5)
                v = 0.4 * v + rng.gauss(0, 1)
                file.write("%r,%r,%r,%r\n" % (START + DT * (number * ROWS + row), v, rng.gauss(0, 1), risk))
        os.rename(path + ".tmp", path)


def seconds(stamp):
    """Of a stamp of either ROS."""
    return getattr(stamp, "secs", getattr(stamp, "sec", 0)) + 1e-9 * getattr(stamp, "nsecs", getattr(stamp, "nanosec", 0))


def confirmed(message):
    return [change for change in message.changes if change.status == 1]


def check(message):
    """The last message of /roscausal/model_changes."""
    first = confirmed(message)[0]
    off = START + DT * OFF * ROWS
    assert (first.cause, first.effect, first.lag, first.kind) == ("h_v", "h_risk", 1, "vanished"), message
    assert off < seconds(first.told) <= off + 3 * DT * ROWS, message
    assert seconds(first.changed_from) - 5 < off < seconds(first.changed_to) + 5, message
    before = [change for change in message.changes if change.id == first.id]
    assert [change.status for change in before] == [0, 1], "it is suspected first: %s" % message
    assert all(seconds(change.told) > off for change in confirmed(message)), "a false alarm: %s" % message
    return "%s, told %.0f s after it" % (first.description, seconds(first.told) - off)
