"""A second vendor's DDS: Cyclone DDS through its own Python binding, with no ROS code on that side."""

import csv
import glob
import os
import tempfile
import time
from dataclasses import dataclass

os.environ["CYCLONEDDS_URI"] = (
    "<CycloneDDS><Domain><General><Interfaces><NetworkInterface address='127.0.0.1'/></Interfaces>"
    "<AllowMulticast>false</AllowMulticast></General><Discovery><ParticipantIndex>auto</ParticipantIndex>"
    "<MaxAutoParticipantIndex>60</MaxAutoParticipantIndex><Peers><Peer address='127.0.0.1'/></Peers>"
    "</Discovery></Domain></CycloneDDS>"
)

from cyclonedds.core import Policy, Qos
from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.annotations import final
from cyclonedds.idl.types import array, float32, float64, int16, int32, sequence, uint8, uint32
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration

from harness import node, peer, test


def ros(package, name):
    return {"typename": f"{package}::msg::dds_::{name}_"}


@dataclass
@final
class Time(IdlStruct, **ros("builtin_interfaces", "Time")):
    sec: int32 = 0
    nanosec: uint32 = 0


@dataclass
@final
class Header(IdlStruct, **ros("std_msgs", "Header")):
    stamp: Time
    frame_id: str = ""


@dataclass
@final
class Dimension(IdlStruct, **ros("std_msgs", "MultiArrayDimension")):
    label: str
    size: uint32
    stride: uint32


@dataclass
@final
class Layout(IdlStruct, **ros("std_msgs", "MultiArrayLayout")):
    dim: sequence[Dimension]
    data_offset: uint32


@dataclass
@final
class Int32MultiArray(IdlStruct, **ros("std_msgs", "Int32MultiArray")):
    layout: Layout
    data: sequence[int32]


@dataclass
@final
class Float32MultiArray(IdlStruct, **ros("std_msgs", "Float32MultiArray")):
    layout: Layout
    data: sequence[float32]


@dataclass
@final
class CausalModel(IdlStruct, **ros("roscausal_msgs", "CausalModel")):
    header: Header
    features: sequence[str]
    causal_structure: Int32MultiArray
    val_matrix: Float32MultiArray
    pval_matrix: Float32MultiArray
    original_shape: sequence[int32]


@dataclass
@final
class PoseWithCovariance(IdlStruct, **ros("geometry_msgs", "PoseWithCovariance")):
    pose: array[float64, 7]
    covariance: array[float64, 36]


@dataclass
@final
class PoseWithCovarianceStamped(IdlStruct, **ros("geometry_msgs", "PoseWithCovarianceStamped")):
    header: Header
    pose: PoseWithCovariance


@dataclass
@final
class PoseStamped(IdlStruct, **ros("geometry_msgs", "PoseStamped")):
    header: Header
    pose: array[float64, 7]


@dataclass
@final
class Feedback(IdlStruct, typename="nav2_msgs::action::dds_::NavigateToPose_Feedback_"):
    current_pose: PoseStamped
    navigation_time: Time
    estimated_time_remaining: Time
    number_of_recoveries: int16
    distance_remaining: float32


@dataclass
@final
class FeedbackMessage(IdlStruct, typename="nav2_msgs::action::dds_::NavigateToPose_FeedbackMessage_"):
    goal_id: array[uint8, 16]
    feedback: Feedback


def qos(latched=False):
    return Qos(
        Policy.Reliability.Reliable(duration(milliseconds=100)),
        Policy.Durability.TransientLocal if latched else Policy.Durability.Volatile,
        Policy.History.KeepLast(10),
        Policy.DataRepresentation(use_cdrv0_representation=True),
    )


def take(reader, seconds, before=lambda: None):
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        before()
        if samples := reader.take(10):
            return samples
        time.sleep(0.05)
    raise AssertionError(f"nothing from our side within {seconds} s")


@test
def cyclone_dds_gets_the_latched_model_and_messages_both_ways():
    participant = DomainParticipant(int(os.environ["ROS_DOMAIN_ID"]))
    with peer("model", count=2, n_vars=20, n_lags=6) as sender:
        end = time.monotonic() + 10
        while "2 models sent" not in sender.log():
            assert time.monotonic() < end, "no models"
            time.sleep(0.05)
        reader = DataReader(participant, Topic(participant, "rt/model", CausalModel), qos=qos(latched=True))
        models = take(reader, 15)
        assert [model.header.frame_id for model in models] == ["model 1"]
        assert len(models[0].val_matrix.data) == 2400 and models[0].val_matrix.data[-1] == 2399 * 0.5
    name = "geometry_msgs/PoseWithCovarianceStamped"
    with peer("echo"):
        writer = DataWriter(participant, Topic(participant, f"rt/in/{name}", PoseWithCovarianceStamped), qos=qos())
        reader = DataReader(participant, Topic(participant, f"rt/out/{name}", PoseWithCovarianceStamped), qos=qos())
        pose = PoseWithCovariance([float(i) for i in range(7)], [i / 8 for i in range(36)])
        sent = PoseWithCovarianceStamped(Header(Time(5, 6), "map"), pose)
        back = take(reader, 15, lambda: writer.write(sent))
        assert back[0] == sent, back[0]


@test
def the_feedback_of_nav2s_action_is_recorded_live_without_a_definition():
    participant = DomainParticipant(int(os.environ["ROS_DOMAIN_ID"]))
    topic = Topic(participant, "rt/navigate_to_pose/_action/feedback", FeedbackMessage)
    writer = DataWriter(participant, topic, qos=qos())
    here = PoseStamped(Header(Time(5, 6), "map"), [0.0] * 7)
    message = FeedbackMessage([7] * 16, Feedback(here, Time(3, 0), Time(4, 0), 2, 6.5))
    with tempfile.TemporaryDirectory() as folder:
        given = ["data_dir:=" + folder, "pp_data_dir:=" + folder + "/pp", "ts_length:=2.0", "sel_agent:=nobody"]
        given.append("signals:=['left = /navigate_to_pose/_action/feedback.feedback.distance_remaining']")
        with node("data", *(word for one in given for word in ("-p", one)), env={"AMENT_PREFIX_PATH": ""}):
            end = time.monotonic() + 60
            while not (paths := glob.glob(folder + "/*.csv")):
                assert time.monotonic() < end, "no batch"
                writer.write(message)
                time.sleep(0.05)
        with open(paths[0], newline="") as file:
            values = [row["left"] for row in csv.DictReader(file)]
    assert values.count("6.5") >= len(values) - 3 and len(values) >= 15, values
    return f"{len(values)} rows"
