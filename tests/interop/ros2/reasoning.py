"""The reasoning node with rclpy: its three services against a system whose answers are known, questions that cannot be asked, no
model yet, ten callers at once, and a restart."""

import contextlib
import json
import math
import os
import signal
import sys
import tempfile
import time

from builtin_interfaces.msg import Time
from nav2_msgs.msg import CostmapFilterInfo, SpeedLimit
from nav_msgs.msg import OccupancyGrid
from rclpy.qos import QoSProfile, ReliabilityPolicy
from std_msgs.msg import Float64, String

sys.path.insert(0, os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
import house
import known_system
from harness import Program, Ros, node, test
from roscausal_msgs.msg import Action, CausalLink, CausalModelInfo, CostTerm, Features, Intervention, Limit, Prediction, RobotState
from roscausal_msgs.srv import Effect, Explain, Route, WhatIf
from wire import LATCHED

OK, NOT_SUPPORTED, NO_MODEL, NO_DATA, BAD_REQUEST = (getattr(WhatIf.Response, name) for name in (
    "OK", "NOT_SUPPORTED", "NO_MODEL", "NO_DATA", "BAD_REQUEST"))
STREAM = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)


def reasoning(batch, graph=None, *more):
    given = ["-p", f"data:=['{batch}']", "-p", "equations:=linear", "-p", "paths:=200", *more]
    return node("reasoning", *given, *(["-p", f"graph:={graph}"] if graph else []))


def sets(name, r_v, last=0):
    return Action(name=name, interventions=[Intervention(variable="r_v", type=Intervention.SET, first_step=1, last_step=last, values=[r_v])])


def what_if(*actions, **more):
    return WhatIf.Request(**{"horizon": 5, "actions": list(actions), **more})


def answered(ros, kind, name, request, status=OK):
    """The answer; asks again while the equations are being fitted."""
    found = []

    def there():
        found.append(ros.call(kind, f"/roscausal/{name}", request))
        return status in (NO_MODEL, NO_DATA) or found[-1].status not in (NO_MODEL, NO_DATA)

    ros.until(there, 60, lambda: f"an answer of {name}: {found[-1:]}")
    assert status in (None, found[-1].status), found[-1]
    return found[-1]


def features(stamp_s, row):
    message = Features(names=list(known_system.NAMES), values=[float(x) for x in row])
    message.header.stamp = Time(sec=int(stamp_s), nanosec=round(stamp_s % 1 * 1e9))
    return message


@test
def the_three_services_give_the_known_answers():
    with tempfile.TemporaryDirectory() as folder:
        batch, graph, rows = known_system.write(folder)
        with reasoning(batch, graph), Ros() as ros:
            question = what_if(sets("stop", 0.2), Action(name="go on"), cost=[CostTerm(variable="h_v", weight=-1.0)],
                               limits=[Limit(variable="d", above=1.0, below=math.nan, probability=0.9)])
            got = answered(ros, WhatIf, "what_if", question)
            assert [outlook.action for outlook in got.outlooks] == ["stop", "go on"] and abs(got.dt - 0.3) < 1e-9, got
            for outlook, r_v in zip(got.outlooks, (0.2, None)):
                truth = known_system.expected(rows[-1], 5, r_v)
                by_name = {forecast.variable: forecast for forecast in outlook.forecasts}
                for k, row in enumerate(truth):
                    for name, value in zip(known_system.NAMES, row):
                        assert abs(by_name[name].mean[k] - value) < 0.08, (outlook.action, name, k, by_name[name].mean[k], value)
                assert outlook.supported_steps == 5 and outlook.probability_limits > 0.9 and outlook.text, outlook
            # a slow robot keeps them near, and a small distance slows them: to go on is better
            assert list(got.ranking) == [1, 0] and got.outlooks[1].probability_best > 0.5, got
            assert any("never imposed" in caveat for caveat in got.caveats), got.caveats

            effect = answered(ros, Effect, "effect", Effect.Request(cause="r_v", effect="h_v", max_lag=4))
            for lag in range(1, 5):
                assert abs(effect.total[lag] - known_system.pulse(lag)) < 0.05, (lag, effect.total, known_system.pulse(lag))
            assert "d" in effect.mediators and effect.text, effect

            why = answered(ros, Explain, "explain", Explain.Request(variable="h_v"))
            parts = why.expected + sum(one.value for one in why.contributions)
            assert abs(parts - why.change) < 1e-9 and why.text, why

            # what happened, again under an action: nothing was done, nothing changes
            then = Time(sec=200, nanosec=0)
            had = answered(ros, WhatIf, "what_if", what_if(Action(name="go on"), counterfactual=True, stamp=then))
            at = round((200 - 100) / known_system.DT)
            h_v = next(f for f in had.outlooks[0].forecasts if f.variable == "h_v")
            assert all(abs(h_v.mean[k] - rows[at + 1 + k][2]) < 1e-4 for k in range(5)), (h_v.mean, rows[at + 1 : at + 6])


@test
def a_question_that_cannot_be_asked_gets_a_status_and_a_sentence_and_the_next_is_answered():
    bad = [
        (what_if(sets("stop", 9.0)), NOT_SUPPORTED, "seen"),
        (what_if(Action(name="fly", interventions=[Intervention(variable="r_w", first_step=1, values=[0.0])])), BAD_REQUEST, "r_v"),
        (what_if(Action(name="now", interventions=[Intervention(variable="r_v", first_step=0, values=[0.0])])), BAD_REQUEST, "step 0"),
        (what_if(Action(name="nothing")), BAD_REQUEST, "go on"),
        (what_if(sets("nan", math.nan)), BAD_REQUEST, "finite"),
        (what_if(sets("far", 0.3), horizon=10**9), BAD_REQUEST, "1000"),
        (what_if(*(sets(f"a{k}", 0.3) for k in range(1000))), BAD_REQUEST, "100"),
        (what_if(Action(name="both", interventions=[sets("", 0.3).interventions[0],
                 Intervention(variable="r_v", type=Intervention.SHIFT, first_step=1, values=[0.1])])), BAD_REQUEST, "twice"),
        (what_if(Action(name="odd", interventions=[Intervention(variable="r_v", type=9, first_step=1, values=[0.1])])), BAD_REQUEST, "SHIFT"),
        (what_if(Action(name="go on"), stamp=Time(sec=1, nanosec=0)), NO_DATA, ""),
        (what_if(Action(name="go on"), counterfactual=True), NO_DATA, "earlier"),
    ]
    with tempfile.TemporaryDirectory() as folder:
        batch, graph, _ = known_system.write(folder)
        with reasoning(batch, graph) as program, Ros() as ros:
            good = what_if(sets("stop", 0.2))
            first = answered(ros, WhatIf, "what_if", good)
            for question, status, words in bad:
                got = ros.call(WhatIf, "/roscausal/what_if", question)
                assert got.status == status and words in got.message and len(got.message) > 20, (status, words, got)
            again = answered(ros, WhatIf, "what_if", good)
            assert str(again.outlooks) == str(first.outlooks), "the same question, another answer"
            for kind, name, request in (
                (Explain, "explain", Explain.Request(variable="h_w")),
                (Explain, "explain", Explain.Request(variable="h_v", to_time=Time(sec=150, nanosec=0))),
                (Effect, "effect", Effect.Request(cause="r_v", effect="nobody")),
                (Effect, "effect", Effect.Request(cause="r_v", effect="h_v", max_lag=2**32 - 1)),
            ):
                got = ros.call(kind, f"/roscausal/{name}", request)
                assert got.status == BAD_REQUEST and len(got.message) > 20, got
            assert program.process.poll() is None


@test
def without_a_model_the_answer_says_so_until_one_comes_and_each_row_gives_a_prediction():
    with tempfile.TemporaryDirectory() as folder:
        batch, _, rows = known_system.write(folder)
        with reasoning(batch), Ros() as ros:
            got = answered(ros, WhatIf, "what_if", what_if(Action(name="go on")), NO_MODEL)
            assert "roscausal_discovery" in got.message, got
            info = CausalModelInfo(batch_id="batch", method="pcmci", cond_ind_test="parcorr", min_lag=1, max_lag=1, dt=0.3,
                                   candidate_features=list(known_system.NAMES))
            info.links = [CausalLink(cause=a, effect=b, lag=1, p_value=0.01) for a, b in (
                ("r_v", "r_v"), ("d", "d"), ("h_v", "h_v"), ("r_v", "d"), ("d", "h_v"))]
            ros.node.create_publisher(CausalModelInfo, "/roscausal/causal_model_info", LATCHED).publish(info)
            answered(ros, WhatIf, "what_if", what_if(Action(name="go on")))
            predictions = []
            ros.node.create_subscription(Prediction, "/roscausal/prediction", predictions.append, STREAM)
            stream = ros.node.create_publisher(Features, "/roscausal/features", STREAM)
            row, sent = rows[-1], [0]
            follows = 100 + known_system.DT * len(rows)

            def tick():
                nonlocal row
                row = known_system.step(row)
                stream.publish(features(follows + known_system.DT * sent[0], row))
                sent[0] += 1

            timer = ros.node.create_timer(0.1, tick)
            ros.until(lambda: len(predictions) >= 3, 20, "three predictions")
            ros.node.destroy_timer(timer)
            last = predictions[-1]
            stamp = last.header.stamp.sec + 1e-9 * last.header.stamp.nanosec
            known = rows[-1]
            for _ in range(round((stamp - follows) / known_system.DT) + 1):
                known = known_system.step(known)
            h_v = next(f for f in last.forecasts if f.variable == "h_v")
            assert all(abs(h_v.mean[k] - truth[2]) < 0.08 for k, truth in enumerate(known_system.expected(known, 5))), (stamp, h_v.mean)


@test
def a_mark_means_the_same_in_a_message_and_in_a_file():
    """What the command reads is the file, what the robot hears is the message."""
    question = what_if(sets("stop", 0.2), Action(name="go on"))
    heard = lambda got: (got.status, [(outlook.action, str(outlook.forecasts)) for outlook in got.outlooks], list(got.ranking))
    for last in known_system.MARKS:
        with tempfile.TemporaryDirectory() as folder:
            batch, graph, _ = known_system.write(folder, last=last)
            with reasoning(batch, graph), Ros() as ros:
                of_file = answered(ros, WhatIf, "what_if", question, status=None)
            info = CausalModelInfo(batch_id="batch", min_lag=0, max_lag=1, dt=known_system.DT, candidate_features=list(known_system.NAMES))
            info.links = [CausalLink(cause=cause, effect=effect, lag=lag, mark=mark, tested=True, p_value=0.01)
                          for cause, effect, lag, mark in known_system.links(last)]
            with reasoning(batch), Ros() as ros:
                ros.node.create_publisher(CausalModelInfo, "/roscausal/causal_model_info", LATCHED).publish(info)
                of_message = answered(ros, WhatIf, "what_if", question, status=None)
            assert heard(of_message) == heard(of_file), (last, of_message, of_file)
            assert of_file.outlooks, (last, of_file)


@test
def ten_callers_at_once_all_get_their_own_answer():
    with tempfile.TemporaryDirectory() as folder:
        batch, graph, rows = known_system.write(folder)
        with reasoning(batch, graph), Ros() as ros:
            answered(ros, WhatIf, "what_if", what_if(sets("stop", 0.2)))
            clients = [ros.node.create_client(WhatIf, "/roscausal/what_if") for _ in range(10)]
            ros.until(lambda: all(client.service_is_ready() for client in clients), 20, "ten clients")
            ros.spin(1)  # a ready client does not mean that the server knows it
            speeds = [0.1 + 0.05 * k for k in range(10)]
            # A client keeps the last ten answers of its service, to whomever they go; so all ask again when all have theirs.
            answers = [[] for _ in clients]
            for _ in range(3):
                questions = [client.call_async(what_if(sets(f"{speed:.2f}", speed), allow_extrapolation=True))
                             for client, speed in zip(clients, speeds)]
                ros.until(lambda: all(question.done() for question in questions), 20, lambda: f"ten answers: {answers}")
                for question, got in zip(questions, answers):
                    got.append(question.result())
            for three, speed in zip(answers, speeds):
                for got in three:
                    assert got.status == OK and [o.action for o in got.outlooks] == [f"{speed:.2f}"], got
                    d = next(f for f in got.outlooks[0].forecasts if f.variable == "d")
                    truth = known_system.expected(rows[-1], 5, speed)
                    assert all(abs(d.mean[k] - truth[k][1]) < 0.08 for k in range(5)), (speed, d.mean, truth)


@test
def a_restarted_node_has_its_rows_again_and_the_same_client_its_answer():
    with tempfile.TemporaryDirectory() as folder:
        batch, graph, _ = known_system.write(folder)
        question = what_if(sets("stop", 0.2))
        with Ros() as ros:
            with reasoning(batch, graph) as program:
                first = answered(ros, WhatIf, "what_if", question)
                program.end(signal.SIGKILL)
            with reasoning(batch, graph):
                again = answered(ros, WhatIf, "what_if", question)
            assert str(again.outlooks) == str(first.outlooks) and again.model_id == first.model_id


@test
def the_example_planner_chooses_the_speed_that_the_answers_favour():
    """Progress pays: the fastest speed. Without a node: the slowest."""
    script = os.path.join(os.environ["ROSCAUSAL_ROOT"], "examples/planner/planner_ros2.py")
    planner = [sys.executable, script, "--ros-args", "-p", "cost:=['d=0.1', 'r_v=-1.0']"]
    with tempfile.TemporaryDirectory() as folder, Ros() as ros:
        batch, graph, _ = known_system.write(folder, noise=known_system.WIDE)
        limits = []
        ros.node.create_subscription(SpeedLimit, "/speed_limit", lambda message: limits.append(message.speed_limit), 10)
        with reasoning(batch, graph, "-p", "allow_extrapolation:=true") as program, Program(planner) as chooses:
            ros.until(lambda: limits and limits[-1] == 0.8, 40, lambda: f"0.8 m/s: {limits[-3:]}\n{chooses.log()}")
            program.end()
            ros.until(lambda: limits[-1] == 0.2, 30, lambda: f"the slowest speed: {limits[-3:]}\n{chooses.log()}")


@test
def the_advisor_limits_nav2s_speed_and_lifts_the_limit_when_nobody_answers():
    """As Nav2's controller server hears it: the speed that the answers favour, in per cent of the top speed; without an answer, and at the
    end of the node, what `otherwise` says."""
    with tempfile.TemporaryDirectory() as folder, Ros() as ros:
        batch, graph, _ = known_system.write(folder, noise=known_system.WIDE)
        limits = []
        ros.node.create_subscription(SpeedLimit, "/speed_limit", limits.append, 10)
        cost = ["-p", "cost:=['d=0.1', 'r_v=-1.0']", "-p", "rate:=5.0"]
        with reasoning(batch, graph, "-p", "allow_extrapolation:=true") as program:
            with node("advisor", *cost, "-p", "top_speed:=1.0", "-p", "percentage:=true", "-p", "patience:=3.0") as advisor:
                is_best = lambda: limits and limits[-1].percentage and limits[-1].speed_limit == 80.0
                ros.until(is_best, 40, lambda: f"80 %: {limits[-3:]}\n{advisor.log()}")
                advisor.end()
                ros.until(lambda: limits[-1].speed_limit == 0.0, 10, lambda: f"no limit: {limits[-3:]}\n{advisor.log()}")
            with node("advisor", *cost, "-p", "otherwise:='0.2'") as advisor:
                ros.until(lambda: limits[-1].speed_limit == 0.8, 40, lambda: f"0.8 m/s: {limits[-3:]}\n{advisor.log()}")
                program.end()
                ros.until(lambda: limits[-1].speed_limit == 0.2, 30, lambda: f"0.2 m/s: {limits[-3:]}\n{advisor.log()}")


@test
def the_watchdog_lifts_the_limit_of_an_advisor_that_was_killed():
    """Nobody is left to lift the last limit, and Nav2 has no time-out for it."""
    with Ros() as ros:
        limits = []
        ros.node.create_subscription(SpeedLimit, "/speed_limit", limits.append, 10)
        with node("watchdog", "-p", "silence:=2.0", "-p", "otherwise:='0.3'") as watchdog:
            with node("advisor", "-p", "rate:=5.0", "-p", "otherwise:='0.2'", "-p", "patience:=0.1") as advisor:
                ros.until(lambda: len(limits) > 5, 30, lambda: f"limits: {limits[-3:]}\n{advisor.log()}")
                assert {limit.speed_limit for limit in limits} == {0.2}, limits
                advisor.end(signal.SIGKILL)
            ros.until(lambda: limits[-1].speed_limit == 0.3, 20, lambda: f"0.3 m/s: {limits[-3:]}\n{watchdog.log()}")


@test
def the_example_planner_drives_the_simulators_robot_at_the_speed_it_chose():
    """Simulator, robot, human, data and reasoning node, and the planner, each a process of its own. While answers come the robot drives
    at the speed that they favour, which is above its own; when they end, at the slowest."""
    script = os.path.join(os.environ["ROSCAUSAL_ROOT"], "examples/planner/planner_ros2.py")
    planner = [sys.executable, script, "--ros-args", "-p", "own_speed:=0.5", "-p", "cost:=['d=0.1', 'r_v=-1.0']"]
    features = ["'r_v = r.v'", "'d = dist(h, r)'", "'h_v = h.v'"]
    with tempfile.TemporaryDirectory() as folder, Ros() as ros, contextlib.ExitStack() as running:
        batch, graph, _ = known_system.write(folder, count=3000, noise=known_system.WIDE)
        speeds, rows = [], []
        ros.node.create_subscription(RobotState, "/roscausal/robot", lambda m: speeds.append(math.hypot(m.twist.linear.x, m.twist.linear.y)), 10)
        ros.node.create_subscription(Features, "/roscausal/features", rows.append, STREAM)
        start = lambda name, *args: running.enter_context(node(name, *args))
        start("hrisim", "-p", "scenario:=encounters")
        start("robot", "-p", "odom_topic:=/mobile_base_controller/odom", "-p", "pose_topic:=/robot_pose",
              "-p", "goal_topic:=/goal_pose", "-p", "goal_type:=PoseStamped")
        start("human", "-p", "source_frame:=map")
        start("data", "-p", f"data_dir:={folder}/raw", "-p", f"pp_data_dir:={folder}/pp", "-p", f"dt:={known_system.DT}",
              "-p", f"features:=[{', '.join(features)}]")
        # The equations are those of the known system; the rows that are asked about are the simulator's.
        program = start("reasoning", "-p", f"data:=['{batch}']", "-p", f"graph:={graph}", "-p", "equations:=linear", "-p", "paths:=100",
                        "-p", "refit_every:=3600.0", "-p", "allow_extrapolation:=true")
        chooses = running.enter_context(Program(planner))
        ros.until(lambda: len(rows) >= 5, 40, "five rows of the simulator")
        ros.until(lambda: speeds and speeds[-1] > 0.7, 60, lambda: f"0.8 m/s: {speeds[-3:]}\n{chooses.log()}")
        program.end()
        ros.until(lambda: "no answer: the slowest" in chooses.log(), 30, lambda: f"the slowest: {chooses.log()}")
        ros.spin(3)
        del speeds[:]
        ros.spin(4)
        assert speeds and max(speeds) < 0.25, speeds


@test
def a_question_that_needs_no_computation_there_and_back():
    """What a service adds to the computation: questions that are refused at once. The note has the figure."""
    with tempfile.TemporaryDirectory() as folder, Ros() as ros:
        batch, graph, _ = known_system.write(folder)
        with reasoning(batch, graph):
            answered(ros, WhatIf, "what_if", what_if(sets("stop", 0.2)))
            client = ros.node.create_client(Effect, "/roscausal/effect")
            ros.until(client.service_is_ready, 20, "the service")
            took = []
            for _ in range(100):
                start = time.monotonic()
                future = client.call_async(Effect.Request(cause="r_v", effect="nobody"))
                ros.until(future.done, 10, "an answer")
                took.append(time.monotonic() - start)
                assert future.result().status == BAD_REQUEST, future.result()
            return f"median {1000 * sorted(took)[50]:.1f} ms"


@test
def a_robot_asks_for_its_ways_and_drives_them_past_the_crowd():
    with tempfile.TemporaryDirectory() as folder:
        scenario, model, days = house.write(folder)
        given = [f"route_map:={scenario}", f"route_model:={model}", f"route_days:={days}", f"route_hour:={house.offset():.4f}"]
        simulated = [f"scenario:={scenario}", "guided:=true", "speed:=10.0"]
        words = lambda params: [word for param in params for word in ("-p", param)]
        with node("reasoning", *words(given)), Ros() as ros:
            asked = lambda **more: ros.call(Route, "/roscausal/route", Route.Request(**more))
            assert asked(from_place="left", to_place="nowhere", hour=8.5).status == Route.Response.BAD_REQUEST
            assert asked(from_place="left", to_place="right", hour=20.0).status == Route.Response.NOT_SUPPORTED
            grids, infos = [], []
            kept = [ros.node.create_subscription(OccupancyGrid, "/roscausal/route_costs", grids.append, LATCHED),
                    ros.node.create_subscription(CostmapFilterInfo, "/roscausal/route_costs_info", infos.append, LATCHED)]
            ros.until(lambda: grids and infos, 30, "a grid of costs and how to read it")
            house.check_grid(grids[-1])
            assert infos[-1].filter_mask_topic == "/roscausal/route_costs" and infos[-1].multiplier == 1.0, (infos, kept)
            legs, numbers = [], {}
            take = lambda name: lambda message: numbers.__setitem__(name, message.data)
            heard = [ros.node.create_subscription(String, "/hri/leg", lambda message: legs.append(json.loads(message.data)), LATCHED)]
            heard += [ros.node.create_subscription(Float64, name, take(name), 10) for name in
                      ("/battery", "/hour", "/people_counter/upper", "/robot_at/dock_e")]
            way = ros.node.create_publisher(String, "/hri/way", 10)
            with node("hrisim", *words(simulated)):
                for done in range(3):
                    ros.until(lambda: legs and legs[-1], 60, lambda: f"a way to decide on after {done}: {legs}")
                    leg = legs[-1]
                    answer = asked(from_place=leg["from"], to_place=leg["to"], hour=leg["hour"], horizon=leg["wait"],
                                   allowed=leg["allowed"], loaded=leg["loaded"])
                    way.publish(String(data=house.check(answer, leg)))
                    ros.until(lambda: legs[-1] != leg, 60, "the way is taken")
                assert set(numbers) == {"/battery", "/hour", "/people_counter/upper", "/robot_at/dock_e"}, numbers
                assert 0 < numbers["/battery"] < 100 and 8 < numbers["/hour"] < 8.3, numbers
            assert heard
