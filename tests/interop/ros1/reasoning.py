"""The reasoning node with rospy: its three services against a system whose answers are known, questions that cannot be asked, no model
yet, ten callers at once, persistent callers, and a restart."""

import contextlib
import json
import math
import os
import signal
import sys
import tempfile
import threading
import time

import rospy
from dynamic_reconfigure.msg import Config, DoubleParameter
from dynamic_reconfigure.srv import Reconfigure, ReconfigureResponse
from roscausal_msgs.msg import Action, CausalLink, CausalModelInfo, CostTerm, Features, Intervention, Limit, Prediction, RobotState
from roscausal_msgs.srv import (Effect, EffectRequest, Explain, ExplainRequest, Route, RouteRequest, RouteResponse, WhatIf,
                                WhatIfRequest, WhatIfResponse)

sys.path.insert(0, os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
import house
import known_system
from nav_msgs.msg import OccupancyGrid
from std_msgs.msg import Float64, String

from harness import NODE, Group, Process, eventually

group = Group()
case = group.case
OK, NOT_SUPPORTED, NO_MODEL, NO_DATA, BAD_REQUEST = (getattr(WhatIfResponse, name) for name in (
    "OK", "NOT_SUPPORTED", "NO_MODEL", "NO_DATA", "BAD_REQUEST"))
KINDS = {"what_if": WhatIf, "effect": Effect, "explain": Explain, "route": Route}


def reasoning(roscore, batch, graph=None):
    roscore.param("/roscausal_reasoning/data", [batch])
    roscore.param("/roscausal_reasoning/graph", graph or "")
    roscore.param("/roscausal_reasoning/equations", "linear")
    roscore.param("/roscausal_reasoning/paths", 200)
    return Process(NODE, "reasoning")


REFUSES = """
import rospy
from roscausal_msgs.srv import Effect, EffectResponse
rospy.init_node("refuses")
rospy.Service("/rospy_effect", Effect, lambda _: EffectResponse(status=EffectResponse.BAD_REQUEST))
rospy.spin()
"""


def ask(name, request):
    rospy.wait_for_service("/roscausal/" + name, 20)
    return rospy.ServiceProxy("/roscausal/" + name, KINDS[name])(request)


def answered(name, request, status=OK):
    """The answer; asks again while the equations are being fitted."""
    found = []

    def there():
        found.append(ask(name, request))
        return status in (NO_MODEL, NO_DATA) or found[-1].status not in (NO_MODEL, NO_DATA)

    eventually(there, 60, lambda: "an answer of %s: %s" % (name, found[-1:]), period=0.1)
    assert status in (None, found[-1].status), found[-1]
    return found[-1]


def sets(name, r_v):
    return Action(name=name, interventions=[Intervention(variable="r_v", type=Intervention.SET, first_step=1, values=[r_v])])


def what_if(*actions, **more):
    return WhatIfRequest(**{"horizon": 5, "actions": list(actions), **more})


def means(outlook, variable):
    return next(forecast.mean for forecast in outlook.forecasts if forecast.variable == variable)


@case
def the_three_services_give_the_known_answers(roscore):
    with tempfile.TemporaryDirectory() as folder:
        batch, graph, rows = known_system.write(folder)
        with reasoning(roscore, batch, graph):
            question = what_if(sets("stop", 0.2), Action(name="go on"), cost=[CostTerm(variable="h_v", weight=-1.0)],
                               limits=[Limit(variable="d", above=1.0, below=math.nan, probability=0.9)])
            got = answered("what_if", question)
            assert [outlook.action for outlook in got.outlooks] == ["stop", "go on"] and abs(got.dt - 0.3) < 1e-9, got
            for outlook, r_v in zip(got.outlooks, (0.2, None)):
                for k, row in enumerate(known_system.expected(rows[-1], 5, r_v)):
                    for name, value in zip(known_system.NAMES, row):
                        assert abs(means(outlook, name)[k] - value) < 0.08, (outlook.action, name, k, means(outlook, name), value)
                assert outlook.supported_steps == 5 and outlook.probability_limits > 0.9 and outlook.text, outlook
            assert list(got.ranking) == [1, 0] and got.outlooks[1].probability_best > 0.5, got
            assert any("never imposed" in caveat for caveat in got.caveats), got.caveats
            effect = answered("effect", EffectRequest(cause="r_v", effect="h_v", max_lag=4))
            for lag in range(1, 5):
                assert abs(effect.total[lag] - known_system.pulse(lag)) < 0.05, (lag, effect.total, known_system.pulse(lag))
            assert "d" in effect.mediators and effect.text, effect
            why = answered("explain", ExplainRequest(variable="h_v"))
            parts = why.expected + sum(one.value for one in why.contributions)
            assert abs(parts - why.change) < 1e-9 and why.text, why
            had = answered("what_if", what_if(Action(name="go on"), counterfactual=True, stamp=rospy.Time(200)))
            at = round((200 - 100) / known_system.DT)
            assert all(abs(means(had.outlooks[0], "h_v")[k] - rows[at + 1 + k][2]) < 1e-4 for k in range(5)), had


@case
def a_question_that_cannot_be_asked_gets_a_status_and_a_sentence_and_the_next_is_answered(roscore):
    shift = Intervention(variable="r_v", type=Intervention.SHIFT, first_step=1, values=[0.1])
    bad = [
        ("what_if", what_if(sets("stop", 9.0)), NOT_SUPPORTED, "seen"),
        ("what_if", what_if(Action(name="fly", interventions=[Intervention(variable="r_w", first_step=1, values=[0])])), BAD_REQUEST, "r_v"),
        ("what_if", what_if(Action(name="now", interventions=[Intervention(variable="r_v", first_step=0, values=[0])])), BAD_REQUEST, "step 0"),
        ("what_if", what_if(Action(name="nothing")), BAD_REQUEST, "go on"),
        ("what_if", what_if(sets("nan", math.nan)), BAD_REQUEST, "finite"),
        ("what_if", what_if(sets("far", 0.3), horizon=10**9), BAD_REQUEST, "1000"),
        ("what_if", what_if(*(sets("a%d" % k, 0.3) for k in range(1000))), BAD_REQUEST, "100"),
        ("what_if", what_if(Action(name="both", interventions=[sets("", 0.3).interventions[0], shift])), BAD_REQUEST, "twice"),
        ("what_if", what_if(Action(name="go on"), stamp=rospy.Time(1)), NO_DATA, ""),
        ("what_if", what_if(Action(name="go on"), counterfactual=True), NO_DATA, "earlier"),
        ("explain", ExplainRequest(variable="h_w"), BAD_REQUEST, "h_v"),
        ("explain", ExplainRequest(variable="h_v", to_time=rospy.Time(150)), BAD_REQUEST, "both times"),
        ("effect", EffectRequest(cause="r_v", effect="nobody"), BAD_REQUEST, "h_v"),
        ("effect", EffectRequest(cause="r_v", effect="h_v", max_lag=2**32 - 1), BAD_REQUEST, ""),
    ]
    with tempfile.TemporaryDirectory() as folder:
        batch, graph, _ = known_system.write(folder)
        with reasoning(roscore, batch, graph) as program:
            good = what_if(sets("stop", 0.2))
            first = answered("what_if", good)
            for name, question, status, words in bad:
                got = ask(name, question)
                assert got.status == status and words in got.message and len(got.message) > 20, (status, words, got)
            assert str(answered("what_if", good).outlooks) == str(first.outlooks), "the same question, another answer"
            assert program.child.poll() is None


@case
def a_mark_means_the_same_in_a_message_and_in_a_file(roscore):
    """What the command reads is the file, what the robot hears is the message."""
    question = what_if(sets("stop", 0.2), Action(name="go on"))
    heard = lambda got: (got.status, [(outlook.action, str(outlook.forecasts)) for outlook in got.outlooks], list(got.ranking))
    models = rospy.Publisher("/roscausal/causal_model_info", CausalModelInfo, queue_size=1, latch=True)
    for last in known_system.MARKS:
        with tempfile.TemporaryDirectory() as folder:
            batch, graph, _ = known_system.write(folder, last=last)
            with reasoning(roscore, batch, graph):
                of_file = answered("what_if", question, status=None)
            links = [CausalLink(cause=cause, effect=effect, lag=lag, mark=mark, tested=True, p_value=0.01)
                     for cause, effect, lag, mark in known_system.links(last)]
            models.publish(CausalModelInfo(batch_id="batch", min_lag=0, max_lag=1, dt=known_system.DT, links=links,
                                           candidate_features=list(known_system.NAMES)))
            with reasoning(roscore, batch):
                of_message = answered("what_if", question, status=None)
            assert heard(of_message) == heard(of_file), (last, of_message, of_file)
            assert of_file.outlooks, (last, of_file)
    models.unregister()


@case
def without_a_model_the_answer_says_so_until_one_comes_and_each_row_gives_a_prediction(roscore):
    with tempfile.TemporaryDirectory() as folder:
        batch, _, rows = known_system.write(folder)
        with reasoning(roscore, batch):
            got = answered("what_if", what_if(Action(name="go on")), NO_MODEL)
            assert "roscausal_discovery" in got.message, got
            links = [CausalLink(cause=a, effect=b, lag=1, p_value=0.01) for a, b in (
                ("r_v", "r_v"), ("d", "d"), ("h_v", "h_v"), ("r_v", "d"), ("d", "h_v"))]
            info = CausalModelInfo(batch_id="batch", method="pcmci", cond_ind_test="parcorr", min_lag=1, max_lag=1, dt=0.3,
                                   candidate_features=list(known_system.NAMES), links=links)
            models = rospy.Publisher("/roscausal/causal_model_info", CausalModelInfo, queue_size=1, latch=True)
            models.publish(info)
            answered_later = lambda: ask("what_if", what_if(Action(name="go on"))).status == OK
            eventually(answered_later, 30, "an answer after the model came", period=0.1)
            predictions = []
            rospy.Subscriber("/roscausal/prediction", Prediction, predictions.append)
            stream = rospy.Publisher("/roscausal/features", Features, queue_size=10)
            row, sent, follows = rows[-1], 0, 100 + known_system.DT * len(rows)

            def tick():
                nonlocal row, sent
                row = known_system.step(row)
                message = Features(names=list(known_system.NAMES), values=list(row))
                message.header.stamp = rospy.Time.from_sec(follows + known_system.DT * sent)
                stream.publish(message)
                sent += 1
                return len(predictions) >= 3

            eventually(tick, 20, "three predictions", period=0.1)
            last = predictions[-1]
            known = rows[-1]
            for _ in range(round((last.header.stamp.to_sec() - follows) / known_system.DT) + 1):
                known = known_system.step(known)
            h_v = next(forecast.mean for forecast in last.forecasts if forecast.variable == "h_v")
            assert all(abs(h_v[k] - truth[2]) < 0.08 for k, truth in enumerate(known_system.expected(known, 5))), last
            models.unregister()


@case
def ten_callers_at_once_and_persistent_ones_all_get_their_own_answer(roscore):
    with tempfile.TemporaryDirectory() as folder:
        batch, graph, rows = known_system.write(folder)
        with reasoning(roscore, batch, graph):
            answered("what_if", what_if(sets("stop", 0.2)))
            faults = []

            def caller(speed):
                try:
                    proxy = rospy.ServiceProxy("/roscausal/what_if", WhatIf, persistent=True)
                    for _ in range(3):
                        got = proxy(what_if(sets("%.2f" % speed, speed), allow_extrapolation=True))
                        assert got.status == OK and [o.action for o in got.outlooks] == ["%.2f" % speed], got
                        for k, truth in enumerate(known_system.expected(rows[-1], 5, speed)):
                            assert abs(means(got.outlooks[0], "d")[k] - truth[1]) < 0.08, (speed, k, truth, got)
                    proxy.close()
                except Exception as error:  # told by the thread that waits
                    faults.append((speed, error))

            threads = [threading.Thread(target=caller, args=(0.1 + 0.05 * k,)) for k in range(10)]
            for thread in threads:
                thread.start()
            for thread in threads:
                thread.join(60)
            assert not faults and not any(thread.is_alive() for thread in threads), faults


@case
def a_restarted_node_has_its_rows_again_and_gives_the_same_answer(roscore):
    with tempfile.TemporaryDirectory() as folder:
        batch, graph, _ = known_system.write(folder)
        question = what_if(sets("stop", 0.2))
        with reasoning(roscore, batch, graph) as program:
            first = answered("what_if", question)
            program.send(signal.SIGKILL)
            program.ended(10)

        def again():
            try:
                got = ask("what_if", question)
            except (rospy.ServiceException, rospy.ROSException):
                return None  # the master still names the one that was killed
            return got if got.status == OK else None

        with reasoning(roscore, batch, graph):
            time.sleep(0.2)
            got = eventually(again, 30, "an answer of the new node", period=0.2)
        assert str(got.outlooks) == str(first.outlooks) and got.model_id == first.model_id


@case
def the_advisor_sets_a_planner_s_top_speed_and_the_watchdog_gives_it_back_after_a_kill(roscore):
    speeds = [0.55]

    def set_parameters(request):
        speeds.extend(double.value for double in request.config.doubles if double.name == "max_vel_x")
        return ReconfigureResponse(Config(doubles=[DoubleParameter("max_vel_x", speeds[-1])]))

    service = rospy.Service("/move_base/DWAPlannerROS/set_parameters", Reconfigure, set_parameters)
    for node in ("advisor", "watchdog"):
        roscore.param("/roscausal_%s/planner" % node, "/move_base/DWAPlannerROS")
    # to be slow pays
    roscore.param("/roscausal_advisor/cost", ["r_v=1.0"])
    roscore.param("/roscausal_watchdog/silence", 1.0)
    with tempfile.TemporaryDirectory() as folder:
        batch, graph, _ = known_system.write(folder, noise=known_system.WIDE)
        roscore.param("/roscausal_reasoning/allow_extrapolation", True)
        with reasoning(roscore, batch, graph), Process(NODE, "watchdog"), Process(NODE, "advisor") as advisor:
            eventually(lambda: speeds[-1] == 0.2, 40, lambda: "0.2 m/s: %s\n%s" % (speeds, advisor.text))
            advisor.send(signal.SIGKILL)
            eventually(lambda: speeds[-1] == 0.55, 20, lambda: "its own 0.55 m/s: %s" % speeds)
            assert max(speeds) == 0.55, speeds
    service.shutdown()


@case
def the_example_planner_chooses_the_speed_that_the_answers_favour(roscore):
    """Progress pays: the fastest speed. A node that ends: the slowest."""
    root = os.environ.get("ROSCAUSAL_ROOT", os.path.dirname(os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))))
    limits = []
    rospy.Subscriber("/speed_limit", Float64, lambda message: limits.append(message.data))
    with tempfile.TemporaryDirectory() as folder:
        batch, graph, _ = known_system.write(folder, noise=known_system.WIDE)
        roscore.param("/roscausal_reasoning/allow_extrapolation", True)
        roscore.param("/planner/cost", ["d=0.1", "r_v=-1.0"])
        with reasoning(roscore, batch, graph) as program:
            with Process("/usr/bin/python3", os.path.join(root, "examples/planner/planner_ros1.py")) as planner:
                eventually(lambda: limits and limits[-1] == 0.8, 30, lambda: "0.8 m/s: %s\n%s" % (limits[-3:], planner.text))
                program.end()
                eventually(lambda: limits[-1] == 0.2, 20, lambda: "the slowest speed: %s\n%s" % (limits[-3:], planner.text))


@case
def the_example_planner_drives_the_simulators_robot_at_the_speed_it_chose(roscore):
    """Simulator, robot, human, data and reasoning node, and the planner, each a process of its own. While answers come the robot drives
    at the speed that they favour, which is above its own; when they end, at the slowest."""
    root = os.environ.get("ROSCAUSAL_ROOT", os.path.dirname(os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))))
    speeds, rows = [], []
    heard = [rospy.Subscriber("/roscausal/robot", RobotState, lambda m: speeds.append(math.hypot(m.twist.linear.x, m.twist.linear.y))),
             rospy.Subscriber("/roscausal/features", Features, rows.append)]
    with tempfile.TemporaryDirectory() as folder, contextlib.ExitStack() as running:
        batch, graph, _ = known_system.write(folder, count=3000, noise=known_system.WIDE)
        given = {
            "roscausal_hrisim/scenario": "encounters", "roscausal_robot/goal_topic": "/goal_pose", "roscausal_robot/goal_type": "PoseStamped",
            "roscausal_human/source_frame": "map", "roscausal_data/data_dir": folder + "/raw", "roscausal_data/pp_data_dir": folder + "/pp",
            "roscausal_data/dt": known_system.DT, "roscausal_data/features": ["r_v = r.v", "d = dist(h, r)", "h_v = h.v"],
            # The equations are those of the known system; the rows that are asked about are the simulator's.
            "roscausal_reasoning/refit_every": 3600.0, "roscausal_reasoning/allow_extrapolation": True,
            "planner/cost": ["d=0.1", "r_v=-1.0"], "planner/own_speed": 0.5}
        for name, value in given.items():
            roscore.param("/" + name, value)
        roscore.param("/use_sim_time", True)
        try:
            for name in ("robot", "human", "data", "hrisim"):
                running.enter_context(Process(NODE, name))
            program = running.enter_context(reasoning(roscore, batch, graph))
            planner = running.enter_context(Process("/usr/bin/python3", os.path.join(root, "examples/planner/planner_ros1.py")))
            eventually(lambda: len(rows) >= 5, 60, "five rows of the simulator", period=0.1)
            eventually(lambda: speeds and speeds[-1] > 0.7, 120, lambda: "0.8 m/s: %s\n%s" % (speeds[-3:], planner.text), period=0.1)
            program.end()
            eventually(lambda: "no answer: the slowest" in planner.text, 60, lambda: "the slowest: " + planner.text, period=0.1)
            time.sleep(3)
            del speeds[:]
            time.sleep(4)
            assert speeds and max(speeds) < 0.25, speeds
        finally:
            roscore.param("/use_sim_time", False)
            for name in {name.split("/")[0] for name in given}:
                roscore.master.deleteParam("/harness", "/" + name)
            for subscriber in heard:
                subscriber.unregister()


@case
def a_question_that_needs_no_computation_there_and_back(roscore):
    """What a service adds to the computation: questions that are refused at once. The note has the figure."""
    with tempfile.TemporaryDirectory() as folder:
        batch, graph, _ = known_system.write(folder)
        with reasoning(roscore, batch, graph):
            answered("what_if", what_if(sets("stop", 0.2)))
            # beside it the same of a server in rospy
            with Process("/usr/bin/python3", "-c", REFUSES) as other:
                medians = []
                for name in ("/roscausal/effect", "/rospy_effect"):
                    rospy.wait_for_service(name, 20)
                    for persistent in (False, True):
                        proxy, took = rospy.ServiceProxy(name, Effect, persistent=persistent), []
                        for _ in range(100):
                            start = time.monotonic()
                            got = proxy(EffectRequest(cause="r_v", effect="nobody"))
                            took.append(time.monotonic() - start)
                            assert got.status == BAD_REQUEST, (got, other.text)
                        proxy.close()
                        medians.append(1000 * sorted(took)[50])
            return "median %.1f ms, %.1f ms over a connection that stays; a server in rospy %.1f ms, %.1f ms" % tuple(medians)


@case
def a_robot_asks_for_its_ways_and_drives_them_past_the_crowd(roscore):
    with tempfile.TemporaryDirectory() as folder:
        scenario, model, days = house.write(folder)
        for name, value in (("map", scenario), ("model", model), ("days", days), ("hour", house.offset())):
            roscore.param("/roscausal_reasoning/route_" + name, value)
        for name, value in (("scenario", scenario), ("guided", True), ("speed", 10.0)):
            roscore.param("/roscausal_hrisim/" + name, value)
        with Process(NODE, "reasoning"):
            asked = lambda **more: ask("route", RouteRequest(**more))
            assert asked(from_place="left", to_place="nowhere", hour=8.5).status == RouteResponse.BAD_REQUEST
            assert asked(from_place="left", to_place="right", hour=20.0).status == RouteResponse.NOT_SUPPORTED
            house.check_grid(rospy.wait_for_message("/roscausal/route_costs", OccupancyGrid, 30))
            legs, numbers = [], {}
            topics = ("/battery", "/hour", "/people_counter/upper", "/robot_at/dock_e")
            heard = [rospy.Subscriber("/hri/leg", String, lambda message: legs.append(json.loads(message.data)))]
            heard += [rospy.Subscriber(name, Float64, lambda message, name=name: numbers.__setitem__(name, message.data)) for name in topics]
            way = rospy.Publisher("/hri/way", String, queue_size=10)
            with Process(NODE, "hrisim"):
                for done in range(3):
                    eventually(lambda: legs and legs[-1], 120, lambda: "a way to decide on after %d: %s" % (done, legs))
                    leg = legs[-1]
                    answer = asked(from_place=leg["from"], to_place=leg["to"], hour=leg["hour"], horizon=leg["wait"],
                                   allowed=leg["allowed"], loaded=leg["loaded"])
                    eventually(lambda: way.get_num_connections() > 0, 30, "the simulator listens")
                    way.publish(String(house.check(answer, leg)))
                    eventually(lambda: legs[-1] != leg, 120, "the way is taken")
                assert set(numbers) == set(topics), numbers
                assert 0 < numbers["/battery"] < 100 and 8 < numbers["/hour"] < 8.3, numbers
            for one in heard:
                one.unregister()
        for name in ("map", "model", "days"):
            roscore.param("/roscausal_reasoning/route_" + name, "")


if __name__ == "__main__":
    sys.exit(1 if group.run() else 0)
