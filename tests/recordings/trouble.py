"""What goes wrong with recordings, in each format, against the truth: trouble.py FOLDER ROSCAUSAL

A robot drives and a person walks as functions of time, so that every cell of a batch has a true value. rosbags writes bags and databases,
mcap writes MCAP files. Each trouble of docs/recordings.md must give cells within the stated errors, as many as there can be, or its sentence.
"""

import csv
import math
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
from mcap.writer import Writer as McapWriter
from rosbags.rosbag1 import Writer as BagWriter
from rosbags.rosbag2 import StoragePlugin, Writer as Ros2Writer

from people import Scene
from write import BEGIN

SECONDS = 30.0
STEP = 0.04
# Most error of a cell: metres, metres per second.
CLOSE = {"r_x": 0.002, "r_y": 0.002, "r_v": 0.005, "h_x": 0.002, "h_y": 0.002, "h_v": 0.01}


def robot(t):
    return {"r_x": 2 * math.cos(0.2 * t), "r_y": 2 * math.sin(0.2 * t), "r_v": 0.4 + 0.1 * math.sin(1.7 * t)}


def person(t):
    vx, vy = -0.1, 0.9 * math.cos(0.9 * t)
    return {"h_x": 3 - 0.1 * t, "h_y": math.sin(0.9 * t), "h_v": math.hypot(vx, vy), "v": (vx, vy)}


def drift(t):
    """Where the odometry's frame is in the map."""
    return 0.05 * t


def even(i):
    return STEP * i


class Walk:
    """How a recording differs from a sound one; times are seconds after its beginning."""

    seen = staticmethod(even)  # when the tracker saw the person, by number
    stamp = staticmethod(lambda i, t: t)  # what its message says
    came = staticmethod(lambda i, t: t)  # when the recorder got it
    robot_came = staticmethod(lambda i, t: t)
    name = staticmethod(lambda i: "7")
    recorded = staticmethod(lambda t: t)  # the recorder's clock
    clock = None  # what /clock says, by its number; it comes at 50 Hz
    has_place = staticmethod(lambda t: True)  # whether the person's place is a number
    frame = "map"  # of the people
    odom_every = 1  # poses for each odometry message
    tf_every = 0  # robot messages between two transforms of `odom` in `map`
    tf_stamp = staticmethod(lambda t: t)  # what a transform says
    tf_came = staticmethod(lambda t: t)
    tf_static = None  # when the camera's fixed place in the robot's frame is recorded
    hole = 0.0  # seconds that pass in the middle
    laps = 1
    drifts = 0.0  # most error more, where a transform is used after its time or a line spans a gap

    def __init__(self, **differs):
        for what, how in differs.items():
            assert hasattr(self, what), what
            setattr(self, what, how)


def messages(s, walk):
    """(time of recording, topic, type, message) in the order of the file."""
    none, count, events = np.zeros(36), round(SECONDS / STEP), []

    def at(t):
        return BEGIN + round((t + (walk.hole if t > SECONDS / 2 else 0)) * 1e9)

    def add(came, topic, kind, message):
        events.append((at(came), topic, kind, message))

    def place(x, y):
        return s.make("geometry_msgs/PoseWithCovariance", pose=s.pose(x, y), covariance=none)

    if walk.tf_static is not None:
        camera = [s.transform(BEGIN, "map", "camera", 10.0, -2.0, s.turn())]
        add(walk.tf_static, "/tf_static", "tf2_msgs/TFMessage", s.make("tf2_msgs/TFMessage", transforms=camera))
    for i in range(2 * count + 150 if walk.clock else 0):
        now = s.header(at(walk.clock(i)), "").stamp
        add(i * STEP / 2, "/clock", "rosgraph_msgs/Clock", s.make("rosgraph_msgs/Clock", clock=now))
    for i in range(count):
        t = even(i)
        where, came = robot(t), walk.robot_came(i, t)
        twist = s.make("geometry_msgs/TwistWithCovariance", twist=s.twist(where["r_v"], 0), covariance=none)
        if i % walk.odom_every == 0:
            add(came, "/odom", "nav_msgs/Odometry", s.make("nav_msgs/Odometry", header=s.header(at(t), "odom"),
                child_frame_id="base_footprint", pose=place(0, 0), twist=twist))
        add(came, "/amcl_pose", "geometry_msgs/PoseWithCovarianceStamped", s.make("geometry_msgs/PoseWithCovarianceStamped",
            header=s.header(at(t), "map"), pose=place(where["r_x"], where["r_y"])))
        if walk.tf_every and i % walk.tf_every == 0:
            moved = [s.transform(at(walk.tf_stamp(t)), "map", "odom", drift(t), 0.0, s.turn())]
            add(walk.tf_came(t), "/tf", "tf2_msgs/TFMessage", s.make("tf2_msgs/TFMessage", transforms=moved))
        t = walk.seen(i)
        if t is None:
            continue
        where, (vx, vy) = person(t), person(t)["v"]
        x, y = where["h_x"], where["h_y"]
        if not walk.has_place(t):
            x = math.nan
        if walk.frame == "odom":
            x -= drift(t)
        if walk.frame == "camera":
            x, y = x - 10, y + 2
        one = s.make("people_msgs/Person", name=walk.name(i), position=s.point(x, y), velocity=s.point(vx, vy),
            reliability=1.0, tagnames=[], tags=[])
        header = s.header(at(walk.stamp(i, t)), walk.frame)
        add(walk.came(i, t), "/people", "people_msgs/People", s.make("people_msgs/People", header=header, people=[one]))
    events.sort(key=lambda event: event[0])
    return [(BEGIN + round(walk.recorded((time - BEGIN) / 1e9) * 1e9), *rest) for time, *rest in events] * walk.laps


def write(folder, name, ending, events, types):
    """One file; returns its path."""
    path, connections = folder / f"{name}.{ending}", {}
    ros = 1 if ending == "bag" else 2
    full = lambda kind: kind.replace("/", "/msg/")
    if ending == "mcap":
        with open(path, "wb") as file:
            writer = McapWriter(file, chunk_size=65536)
            writer.start(profile="ros2")
            for number, (time, topic, kind, message) in enumerate(events):
                if topic not in connections:
                    text, _ = types.generate_msgdef(full(kind), ros_version=2)
                    schema = writer.register_schema(full(kind), "ros2msg", text.encode())
                    connections[topic] = writer.register_channel(topic, "cdr", schema)
                data = bytes(types.serialize_cdr(message, full(kind)))
                writer.add_message(connections[topic], time, data, time, number)
            writer.finish()
        return path
    if ending == "db3":
        path = folder / f"{name}_db3"
        shutil.rmtree(path, ignore_errors=True)
        writer = Ros2Writer(path, version=9, storage_plugin=StoragePlugin.SQLITE3)
    else:
        path.unlink(missing_ok=True)
        writer = BagWriter(path)
    with writer:
        for time, topic, kind, message in events:
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, full(kind), typestore=types)
            data = types.serialize_ros1(message, full(kind)) if ros == 1 else types.serialize_cdr(message, full(kind))
            writer.write(connections[topic], time, data)
    return path


def in_parts(folder, name, ending, events, types):
    """A folder of three parts, of which the second is missing."""
    whole = folder / f"{name}_{ending}_parts"
    shutil.rmtree(whole, ignore_errors=True)
    whole.mkdir()
    third = len(events) // 3
    parts = []
    for number in range(3):
        part = events[number * third : (number + 1) * third]
        written = write(folder, f"{name}_{number}", ending, part, types)
        if ending == "db3":
            written = next(written.glob("*.db3"))
        written.rename(whole / f"{name}_{number}.{ending}")
        parts.append(f"{name}_{number}.{ending}")
    if ending != "bag":
        storage = "mcap" if ending == "mcap" else "sqlite3"
        listed = "".join(f"    - {part}\n" for part in parts)
        (whole / "metadata.yaml").write_text(
            "rosbag2_bagfile_information:\n  version: 5\n"
            f"  storage_identifier: {storage}\n  relative_file_paths:\n{listed}  compression_format: ''\n  compression_mode: ''\n"
            f"  message_count: {3 * third}\n"
        )
    (whole / parts[1]).unlink()
    return whole


def overlapping(folder, name, ending, events, types):
    """A folder of two parts that share a third."""
    whole = folder / f"{name}_{ending}_parts"
    shutil.rmtree(whole, ignore_errors=True)
    whole.mkdir()
    third = len(events) // 3
    for number in range(2):
        written = write(folder, f"{name}_{number}", ending, events[number * third : (number + 2) * third], types)
        if ending == "db3":
            written = next(written.glob("*.db3"))
        written.rename(whole / f"{name}_{number}.{ending}")
    return whole


class Run:
    """What `discover` prints, and the rows that it makes."""

    def __init__(self, roscausal, path, flags):
        out = path.parent / f"{path.name}.found"
        shutil.rmtree(out, ignore_errors=True)
        command = [roscausal, "discover", str(path), "--person", "7", "--method", "pcmci", "--test", "parcorr", "--drop-empty"]
        # At 25 Hz `auto` would hold, and rows be as old as a sighting: the truth is known of the line between sightings.
        command += ["--param", "data.sampling=linear", "--param", "data.postprocess=none", "--out", str(out), *flags]
        done = subprocess.run(command, capture_output=True, text=True, timeout=120)
        self.said, self.code = done.stdout + done.stderr, done.returncode
        files = sorted((out / "batches").glob("*.csv")) if self.code == 0 else []
        self.batches = [list(csv.DictReader(open(file))) for file in files]


def check(run, walk, cells, batches):
    """Compares all cells with the truth: as many as `cells` of the person, and of the robot, in so many batches."""
    assert run.code == 0, f"exit code {run.code}"
    assert len(run.batches) == batches, f"{len(run.batches)} batches"
    counted = {"h_x": 0, "r_x": 0}
    for row in (row for batch in run.batches for row in batch):
        t = float(row["time"]) - BEGIN / 1e9
        if t > SECONDS / 2 + walk.hole / 2:
            t -= walk.hole
        for column, cell in row.items():
            name = column.replace("h_7_", "h_")
            if name in CLOSE and cell not in ("", "nan", "NaN"):
                true, close = {**robot(t), **person(t)}[name], CLOSE[name] + walk.drifts
                assert abs(float(cell) - true) <= close, f"{column} at {t:.2f} s: {cell} for {true:.4f}"
                if name in counted:
                    counted[name] += 1
    assert min(counted.values()) >= cells, f"{counted} cells, not {cells}"


def jitter(i):
    return even(i) + 0.015 * math.sin(7919.0 * i) if i else 0.0


def ticks(i):
    return i * STEP / 2


def ahead_from(first, by, last=10**9):
    """Stamps that are wrong from one message on."""
    return lambda i, t: t + (by if first <= i < last else 0.0)


def ahead_at(every, by):
    """Single stamps that are ahead."""
    return lambda i, t: t + (by if i % every == 5 else 0.0)


# Sentences are said, or not where they begin with `!`. In place of a number of cells: they are what counts.
SAID = "said"
MENDED = ["--clock", "/people=recording"]
FLAG = " ".join(MENDED)
# Cells of 300: the first and the last second may lack neighbours.
TROUBLES = {
    "sound": (Walk(), [], 295, 1, []),
    "jitter": (Walk(seen=jitter), [], 295, 1, []),
    "lost": (Walk(seen=lambda i: None if i % 10 == 3 else jitter(i)), [], 295, 1, []),
    "glitch": (Walk(stamp=lambda i, t: t + (3e8 if 300 <= i < 306 else 0)), [], 290, 1, ["6 of 750 messages of /people"]),
    "a_little_ahead": (Walk(stamp=ahead_at(20, 0.8)), [], 290, 1, ["38 of 750 messages of /people", "or 0.25 s ahead"]),
    "a_little_ahead_by_clock": (
        Walk(clock=ticks, stamp=ahead_at(20, 0.8)), [], 290, 1, ["38 of 750 messages of /people"]),
    "a_little_ahead_at_2_hz": (
        Walk(seen=lambda i: 0.5 * i if i < 60 else None, stamp=ahead_at(12, 0.4)), [], SAID, 0, ["5 of 60 messages of /people"]),
    "recorder_set_back": (Walk(recorded=lambda t: t - 0.8 if t > 20 else t), [], 290, 1, ["!and are left out"]),
    "often_ahead": (Walk(stamp=ahead_at(6, 0.8)), [], None, 0, ["124 of 750 messages of /people are stamped far", FLAG]),
    "clock_glitch": (  # no jump of the topics that came just after it
        Walk(clock=lambda i: ticks(i) + (2e6 if i == 701 else 0), robot_came=lambda i, t: t + 0.025), [], 295, 1,
        ["1 of 1650 messages of /clock", "!most seconds without"]),
    "clock_from_zero": (
        Walk(clock=lambda i: ticks(i) if i else -BEGIN / 1e9), [], 295, 1, ["1 of 1650 messages of /clock", "!most seconds without"]),
    "late": (Walk(came=lambda i, t: t + 3.0), [], 270, 1, []),
    "late_by_clock": (Walk(clock=ticks, came=lambda i, t: t + 3.0), [], 270, 1, ["stamps of /people are 3.00 s behind"]),
    "early": (Walk(robot_came=lambda i, t: t + 1.5), [], 270, 1, []),
    "wandering": (Walk(came=lambda i, t: t + 1.5 + 1.5 * math.sin(0.3 * t)), [], 295, 1, []),
    "burst": (Walk(came=lambda i, t: max(t, 12.0) if t > 9 else t), [], 295, 1, []),
    "out_of_order": (Walk(robot_came=lambda i, t: t + (0.06 if i % 5 == 2 else 0.0)), [], 295, 1, []),
    "a_little_out_of_order": (
        Walk(robot_came=lambda i, t: t + (0.045 if i % 5 == 2 else 0.0)), [], 295, 1, ["robot node: out of order: "]),
    "equal_stamps": (  # the first of two counts, also where the second is the later one
        Walk(stamp=lambda i, t: even(i - i % 2), came=lambda i, t: t + 0.04), [], 290, 1, []),
    "late_or_slow": (Walk(came=lambda i, t: t + 3.0), [], 270, 1, ["stamps of /people are 3.00 s behind", FLAG]),
    "no_stamp": (
        Walk(stamp=lambda i, t: -BEGIN / 1e9 if 10 < t < 12 else t), [], 295, 1, ["human node: without stamp: 49"]),
    "never_a_stamp": (Walk(stamp=lambda i, t: -BEGIN / 1e9), [], 295, 1, ["human node: without stamp: 750"]),
    "no_place": (Walk(has_place=lambda t: not 10 < t < 12), [], 278, 1, ["human node: not finite: 49"]),
    "stops": (Walk(seen=lambda i: even(i) if i < 375 else None), [], 148, 1, ["human node: most seconds without /people: 1"]),
    "seldom_odometry": (
        Walk(odom_every=12, drifts=0.02), [], 290, 1, ["robot node: poses without odometry: "]),
    "hole": (Walk(hole=7200.0), ["--signal", "seen = count(/people.people)", "--ts-length", "0"], 290, 2, []),
    "loop": (Walk(laps=2), [], 290, 1, ["2 runs", "holds the rows of an earlier one"]),
    "two_clocks": (Walk(stamp=lambda i, t: t - 1.6e9), [], None, 0, ["clocks of /people", "--clock /people=recording"]),
    "two_clocks_mended": (Walk(stamp=lambda i, t: t - 1.6e9), ["--clock", "/people=recording"], 295, 1, []),
    "jump": (Walk(stamp=ahead_from(375, 2.0)), [], None, 0, ["clock of /people jumps", "that of /odom does not", FLAG]),
    "jump_mended": (Walk(stamp=ahead_from(375, 2.0)), MENDED, 295, 1, []),
    "jump_back": (Walk(stamp=ahead_from(375, -10.0)), [], None, 0, ["clock of /people jumps", FLAG]),
    "jump_and_back": (Walk(stamp=ahead_from(375, 30.0, 435)), [], None, 0, ["clock of /people jumps", FLAG]),
    "a_little_back": (Walk(stamp=ahead_from(375, -2.0)), [], SAID, 0, ["stamps of /people move by 2.0 s", FLAG]),
    "slow_clock": (Walk(stamp=lambda i, t: 0.9 * t), [], SAID, 0, ["stamps of /people move by 2.", FLAG]),
    "ahead": (Walk(stamp=ahead_from(0, 0.6)), [], SAID, 0, ["stamps of /people are 0.60 s ahead", FLAG]),
    "ahead_of_late_ones": (
        Walk(stamp=ahead_from(0, 3.0), robot_came=lambda i, t: t + 0.4), [], SAID, 0,
        ["stamps of /people are 3.40 s ahead of all others", "--clock recording"]),
    "whole_seconds": (Walk(stamp=lambda i, t: math.floor(t)), [], SAID, 0, ["of 750 messages of /people have the stamp of the one before"]),
    "microseconds": (  # in the place of nanoseconds
        Walk(stamp=lambda i, t: math.floor(t) + 1e-3 * (t % 1)), [], SAID, 0, ["720 of 750 messages of /people have the stamp of the one before"]),
    "tf_clock": (
        Walk(frame="odom", tf_every=1, tf_stamp=lambda t: t + 4.0), [], SAID, 0, ["stamps of /tf are 4.00 s ahead", "--clock /tf=recording"]),
    "tf_clock_mended": (
        Walk(frame="odom", tf_every=1, tf_stamp=lambda t: t + 4.0), ["--clock", "/tf=recording"], 285, 1, []),
    "tf_late": (Walk(frame="odom", tf_every=1, tf_came=lambda t: t + 2.0), [], 285, 1, []),
    "tf_later": (
        Walk(frame="odom", tf_every=1, tf_came=lambda t: t + 4.0), [], 285, 1, ["stamps of /tf are 4.00 s behind", "--clock /tf=recording"]),
    "tf_slow_clock_mended": (
        Walk(frame="odom", tf_every=1, tf_stamp=lambda t: t - 4.0), ["--clock", "/tf=recording"], 285, 1, []),
    "no_static_tf": (Walk(frame="camera"), [], None, 0, ["camera"]),
    "late_static_tf": (Walk(frame="camera", tf_static=20.0), [], 295, 1, []),
    "tf_1hz": (Walk(frame="odom", tf_every=25, drifts=0.2 * drift(1)), [], 285, 1, []),
    "changed_ids": (Walk(name=lambda i: "7" if i < 375 else "12"), [], 145, 1, ["12 where 7 was", "human.rejoin_time=2"]),
    "changed_ids_joined": (
        Walk(name=lambda i: "7" if i < 375 else "12"), ["--param", "human.rejoin_time=2"], 295, 1, []),
}


def main():
    folder, roscausal = Path(sys.argv[1]), sys.argv[2]
    folder.mkdir(parents=True, exist_ok=True)
    scenes, failed, passed = {1: Scene(1), 2: Scene(2)}, 0, 0
    for ending in ("bag", "mcap", "db3"):
        scene = scenes[1 if ending == "bag" else 2]
        runs = [(name, *trouble, write) for name, trouble in TROUBLES.items()]
        # A bag of ROS 1 has no list of its parts.
        named = [] if ending == "bag" else ["missing_1.", "messages that it counts are not there"]
        runs.append(("missing", Walk(), [], 190, 1, named, in_parts))
        runs.append(("overlap", Walk(), [], 295, 1, ["count once"], overlapping))
        for name, walk, flags, cells, batches, sentences, writes in runs:
            path = writes(folder, name, ending, messages(scene, walk), scene.types)
            run = Run(roscausal, path, flags)
            try:
                for sentence in sentences:
                    said = sentence.removeprefix("!") in run.said
                    assert said != sentence.startswith("!"), f"'{sentence}' is {'' if said else 'not '}said"
                if cells == SAID:
                    assert run.code in (0, 1), f"exit code {run.code}"
                elif cells is None:
                    assert run.code == 1, f"exit code {run.code}"
                else:
                    check(run, walk, cells, batches)
                passed += 1
            except AssertionError as wrong:
                failed += 1
                print(f"FAILED {ending} {name}: {wrong}\n{run.said}")
    print(f"{passed} of {passed + failed} recordings with trouble are read as they should be")
    sys.exit(failed > 0)


if __name__ == "__main__":
    main()
