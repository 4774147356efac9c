"""The simulator's robot is switched off while it waits at its waypoint, and nobody says so: the nodes record it, and the discovery
node tells a change of the risk. The settings of the nodes and what they have to tell, for both versions of ROS."""

# The robot waits from second 415 to 419; four batches come before.
TS_LENGTH, OFF = 90, 416
SPEED = 12
# Seconds of a quiet machine until the third batch after it has ended and is analysed.
PATIENCE = (OFF + 3 * TS_LENGTH) / SPEED


def settings(folder):
    """Of each node, in the order in which they are started: the simulator last, so that the others hear its beginning."""
    return {
        "robot": {},
        "human": {},
        "data": {"data_dir": folder + "/raw", "pp_data_dir": folder + "/pp", "ts_length": float(TS_LENGTH), "dt": 0.3, "risk_lag": 1,
                 "risk_noise": 0.02, "context_topic": ""},
        "discovery": {"data_dir": folder + "/pp", "res_dir": folder + "/models", "cd_method": "pcmci", "cond_ind_test": "parcorr",
                      "window_batches": 4},
        "hrisim": {"scenario": "pass_by_the_centre", "seed": 1, "duration": OFF + 4.0 * TS_LENGTH, "speed": float(SPEED), "every": 2,
                   "do": ["robot.off@%d.." % OFF]},
    }


def seconds(stamp):
    """Of a stamp of either ROS."""
    return getattr(stamp, "secs", getattr(stamp, "sec", 0)) + 1e-9 * getattr(stamp, "nsecs", getattr(stamp, "nanosec", 0))


def confirmed(message):
    return [change for change in message.changes if change.status == 1]


def check(message):
    """The last message of /roscausal/model_changes."""
    first = seconds(confirmed(message)[0].told) - OFF
    assert 0 < first <= 3 * TS_LENGTH, "%g s after it: %s" % (first, message)
    of_risk = [change for change in confirmed(message) if "h_risk" in (change.cause, change.effect)]
    assert of_risk and seconds(of_risk[0].told) - OFF <= 3 * TS_LENGTH, message
    return "%s, told %.0f s after it" % (of_risk[0].description, seconds(of_risk[0].told) - OFF)
