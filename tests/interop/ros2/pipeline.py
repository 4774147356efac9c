"""The whole experiment: simulator and four nodes, started as by the launch file, in simulated time. An rclpy
subscriber that joins late gets the causal model."""

import glob
import os
import re
import signal
import tempfile
import time
import urllib.request

import yaml

from harness import INSTALL, Program, Ros, test
from launch_reader import commands
from wire import LATCHED, message_class


def parameters(folder):
    """The installed parameter file for the simulator, with our own folders and a quick analysis."""
    with open(os.path.join(INSTALL, "roscausal/share/roscausal/config/hrisim.yaml")) as file:
        nodes = yaml.safe_load(file)
    dirs = {name: os.path.join(folder, name) for name in ("data_dir", "pp_data_dir", "res_dir")}
    nodes["/**/roscausal_data"]["ros__parameters"].update(
        data_dir=dirs["data_dir"], pp_data_dir=dirs["pp_data_dir"], ts_length=40.0
    )
    nodes["/**/roscausal_discovery"]["ros__parameters"].update(
        # without a filter the model always has all three variables, whatever these 40 s contain
        data_dir=dirs["pp_data_dir"], res_dir=dirs["res_dir"], cond_ind_test="parcorr", cd_method="pcmci"
    )
    nodes["/**/roscausal_dashboard"] = {"ros__parameters": {"port": 0}}
    path = os.path.join(folder, "params.yaml")
    with open(path, "w") as file:
        yaml.safe_dump(nodes, file)
    return path, dirs


@test
def the_pipeline_gives_a_late_joiner_a_causal_model():
    CausalModel, Info = message_class("roscausal_msgs/CausalModel"), message_class("roscausal_msgs/CausalModelInfo")
    MarkerArray = message_class("visualization_msgs/MarkerArray")
    with tempfile.TemporaryDirectory() as folder:
        params, dirs = parameters(folder)
        started = time.monotonic()
        given = {"params_file": params, "speed": "10.0", "dashboard": "true", "markers": "true"}
        lines = commands(INSTALL, "roscausal", "roscausal_hrisim.launch.xml", given)
        programs = [Program([path, *arguments]) for path, arguments in lines]
        try:
            end = time.monotonic() + 90
            while not glob.glob(os.path.join(dirs["res_dir"], "**", "*.json"), recursive=True):
                dead = [p.process.args[0] for p in programs if p.process.poll() is not None]
                assert not dead, f"ended by themselves: {dead}"
                assert time.monotonic() < end, "no model file within 90 s"
                time.sleep(0.1)
            seconds = time.monotonic() - started
            with Ros("late") as ros:
                models, infos, scenes = [], [], []
                ros.node.create_subscription(CausalModel, "/roscausal/causal_model", models.append, LATCHED)
                ros.node.create_subscription(Info, "/roscausal/causal_model_info", infos.append, LATCHED)
                ros.node.create_subscription(MarkerArray, "/roscausal/markers", scenes.append, 10)
                ros.until(lambda: models and infos, 20, "the latched model and its info")
                ros.until(lambda: scenes, 20, "markers")
                # a robot and people, in one frame
                markers = scenes[-1].markers
                assert len(markers) >= 2 and {m.header.frame_id for m in markers} == {"map"}, markers
                logs = "".join(program.log() for program in programs)
                address = re.search(r"the page is at (http://127\.0\.0\.1:\d+/)", logs)
                page = urllib.request.urlopen(address[1], timeout=10).read().decode()
                assert "<html" in page and "Causal model" in page, page[:300]
                model = models[-1]
                # [lag, target, source], as the first line of each matrix' layout says
                n, lags = len(model.features), model.original_shape[0]
                assert n == 3 and list(model.original_shape) == [lags, n, n], model.original_shape
                assert len(model.val_matrix.data) == len(model.causal_structure.data) == n * n * lags
                assert all(0 <= p <= 1 for p in model.pval_matrix.data if p == p)
                nodes = {f"/roscausal_{name}" for name in ("robot", "human", "data", "discovery", "hrisim", "dashboard", "markers")}
                ros.until(lambda: nodes <= set(ros.names()), 10, "all nodes listed")
                participants = ros.participants("roscausal")
                assert len(participants) == len(nodes), f"{len(participants)} participants"
                # at once: even a participant that has only just discovered a node notices its end
                ending = time.monotonic()
                for program in programs:
                    program.send(signal.SIGINT)
                ros.until(
                    lambda: ros.gone("roscausal", participants), 5, lambda: f"all nodes leaving; left: {ros.names()}"
                )
                left = time.monotonic() - ending
            codes = [program.wait() for program in programs]
            assert codes == [0] * len(programs), codes
            assert left < 1.5, f"{left:.2f} s"
            links = sum(1 for value in model.causal_structure.data if value)
            return f"model of {n} variables, {links} links, after {seconds:.0f} s; all nodes gone {left:.2f} s after SIGINT"
        except AssertionError:
            for program in programs:
                print("   ", program.process.args[0])
                print("      " + "\n      ".join(program.log().splitlines()[-12:]))
            raise
        finally:
            for program in programs:
                if program.process.poll() is None:
                    program.process.kill()
                program.process.wait()
