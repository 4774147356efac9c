"""examples/fleet.py: a fleet's recordings on one machine, on Ray and on Dask, of which a process is killed in the middle.

Run by tests/python.sh, where ray, distributed, s3fs and a store like S3 (moto, on 127.0.0.1) are installed.
"""

import collections
import os
import pathlib
import signal
import socket
import subprocess
import sys
import time
import uuid

import numpy as np
import pytest
from conftest import ROOT

FLEET = ROOT / "examples" / "fleet.py"
#: Processes that a machine which is busy with other tests may take minutes to start.
PATIENCE = 900
FAST = ["--set", "method=pcmci", "--set", "test=parcorr"]
#: About a second for each recording of 300 rows, so that there is a middle to be killed in.
SLOW = ["--set", "method=pcmci", "--set", "test=cmiknn"]


def table(path, seed, rows=150):
    """A robot's recording: `a` drives `b` one step later."""
    x = np.random.default_rng(seed).normal(size=(rows, 3))
    x[1:, 1] += 0.9 * x[:-1, 0]
    times = np.arange(rows) * 0.5
    path.parent.mkdir(parents=True, exist_ok=True)
    np.savetxt(path, np.column_stack([times, x]), "%.9g", ",", header="time,a,b,c", comments="")


def walks(folder, rows=150):
    """Eight recordings of two robots."""
    for number in range(8):
        table(folder / f"robot{number % 2}" / f"walk{number}.csv", number, rows)
    return folder


@pytest.fixture
def recordings(tmp_path):
    return walks(tmp_path / "recordings")


def fleet(*arguments, env=None):
    done = subprocess.run(
        [sys.executable, FLEET, *map(str, arguments)], capture_output=True, text=True, timeout=PATIENCE, env={**os.environ, **(env or {})}
    )
    return done.returncode, done.stdout, done.stderr


def files(folder):
    """All that a run left, but for the versions of what it read."""
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(pathlib.Path(folder).rglob("*"))
        if path.is_file() and path.suffix != ".source"
    }


def test_each_recording_has_its_model_and_all_have_a_summary(recordings, tmp_path):
    code, out, err = fleet(recordings, "--out", tmp_path / "out", *FAST, "--pool", "jpcmciplus")
    assert code == 0, err
    made = files(tmp_path / "out")
    assert [name for name in made if name.startswith("models/")] == sorted(
        f"models/robot{number % 2}/walk{number}.csv.json" for number in range(8)
    )
    header, first, *_ = made["summary.csv"].decode().splitlines()
    assert header == "cause,effect,lag,found_in,recordings,mean_value"
    assert first.startswith("a,b,1,8,8,0.")
    assert b'"n_recordings": 8' in made["pooled.json"], out


def test_a_second_run_keeps_what_is_there_and_makes_what_has_changed(recordings, tmp_path):
    fleet(recordings, "--out", tmp_path / "out", *FAST)
    before = files(tmp_path / "out")
    table(recordings / "robot0" / "walk0.csv", 99, rows=170)
    (tmp_path / "out" / "models" / "robot1" / "walk1.csv.json").unlink()
    code, out, err = fleet(recordings, "--out", tmp_path / "out", *FAST)
    assert code == 0, err
    ended = collections.Counter(line.split()[-1] for line in out.splitlines() if " of 8: " in line)
    assert ended == {"kept": 6, "made": 2}, out
    after = files(tmp_path / "out")
    assert [name for name in before if name.startswith("models/") and before[name] != after[name]] == ["models/robot0/walk0.csv.json"]


def test_other_settings_are_not_mixed_into_a_folder(recordings, tmp_path):
    fleet(recordings, "--out", tmp_path / "out", *FAST)
    code, _, err = fleet(recordings, "--out", tmp_path / "out", *FAST, "--set", "tau_max=2")
    assert code != 0 and "give another --out" in err


def test_a_recording_that_cannot_be_read_is_told_and_the_others_have_models(recordings, tmp_path):
    (recordings / "robot0" / "walk0.csv").write_text("<html>404</html>\n")
    code, out, err = fleet(recordings, "--out", tmp_path / "out", *FAST)
    assert code == 1 and "1 of 8 recordings have no model" in err
    assert "walk0.csv failed: " in out and len(files(tmp_path / "out")) == 7 + 2


def test_a_folder_without_recordings_is_told(tmp_path):
    code, _, err = fleet(tmp_path, "--out", tmp_path / "out")
    assert code != 0 and "there are no recordings" in err


def at_work(marker, title):
    """The processes of a run, known by its variable, that are in the middle of a task."""
    found = []
    for entry in pathlib.Path("/proc").iterdir():
        try:
            if entry.name.isdigit() and title(entry) and marker.encode() in (entry / "environ").read_bytes():
                found.append(int(entry.name))
        except OSError:
            continue
    return found


def begun(command, env, errors):
    """A run and its first line. Ray gives its processes 30 s to start, which is too little on a machine that is busy with other tests."""
    for _ in range(5):
        with errors.open("w") as told:
            run = subprocess.Popen([str(each) for each in command], stdout=subprocess.PIPE, stderr=told, text=True, env=env)
        first = run.stdout.readline()
        if first or "timed out during startup" not in errors.read_text():
            break
        run.wait(PATIENCE)
    return run, first


def of_ray(entry):
    return (entry / "cmdline").read_bytes().startswith(b"ray::analyse")


def of_dask(entry):
    command = (entry / "cmdline").read_bytes()
    return b"multiprocessing" in command and b"spawn_main" in command


@pytest.mark.parametrize(("cluster", "title"), [("ray", of_ray), ("dask", of_dask)])
def test_a_cluster_of_which_a_process_is_killed_gives_the_bytes_of_one_machine(cluster, title, tmp_path):
    recordings = walks(tmp_path / "recordings", rows=300)
    assert fleet(recordings, "--out", tmp_path / "here", *SLOW)[0] == 0
    marker = f"FLEET_TEST={uuid.uuid4()}"
    command = [sys.executable, FLEET, recordings, "--out", tmp_path / cluster, "--on", cluster, "--workers", "3", *SLOW]
    run, first = begun(command, dict(os.environ, **dict([marker.split("=")])), tmp_path / "errors.txt")
    # The first model is there, others are under way.
    assert "1 of 8: " in first, (tmp_path / "errors.txt").read_text()
    deadline = time.monotonic() + PATIENCE
    while not (workers := at_work(marker, title)) and run.poll() is None and time.monotonic() < deadline:
        time.sleep(0.02)
    assert workers, "no process is at work"
    os.kill(workers[0], signal.SIGKILL)
    rest, _ = run.communicate(timeout=PATIENCE)
    assert run.returncode == 0, rest + (tmp_path / "errors.txt").read_text()
    assert files(tmp_path / cluster) == files(tmp_path / "here")


@pytest.mark.parametrize("cluster", ["ray", "dask"])
def test_recordings_travel_to_be_analysed_together(cluster, recordings, tmp_path):
    usual = [sys.executable, FLEET, recordings, *FAST, "--pool", "jpcmciplus", "--out"]
    for out, more in (("here", []), (cluster, ["--on", cluster, "--workers", "2"])):
        run, _ = begun([*usual, tmp_path / out, *more], dict(os.environ), tmp_path / "errors.txt")
        rest, _ = run.communicate(timeout=PATIENCE)
        assert run.returncode == 0, rest + (tmp_path / "errors.txt").read_text()
    assert files(tmp_path / cluster) == files(tmp_path / "here")


def test_what_cannot_be_pooled_is_one_sentence_and_the_models_are_there(recordings, tmp_path):
    code, _, err = fleet(recordings, "--out", tmp_path / "out", "--set", "method=pcmci", "--set", "test=robustparcorr", "--pool", "jpcmciplus")
    assert code != 0 and "none of all recordings together" in err and "Traceback" not in err, err
    assert "summary.csv" in files(tmp_path / "out")


def test_a_models_warnings_name_the_recording_and_not_where_it_lay(tmp_path):
    # A cell that is not a number is told, with the file's name.
    for folder in ("one", "two"):
        table(tmp_path / folder / "walk.csv", 1)
        path = tmp_path / folder / "walk.csv"
        lines = path.read_text().splitlines()
        path.write_text("\n".join([*lines[:9], lines[9].rsplit(",", 1)[0] + ",", *lines[10:], ""]))
        assert fleet(tmp_path / folder, "--out", tmp_path / f"out_{folder}", *FAST)[0] == 0
    assert files(tmp_path / "out_one") == files(tmp_path / "out_two")
    assert str(tmp_path).encode() not in files(tmp_path / "out_one")["models/walk.csv.json"]


@pytest.fixture
def store():
    """A store like S3 on this machine: its variables."""
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    server = subprocess.Popen(
        [sys.executable, "-m", "moto.server", "-H", "127.0.0.1", "-p", str(port)], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    try:
        deadline = time.monotonic() + PATIENCE
        while time.monotonic() < deadline:
            try:
                socket.create_connection(("127.0.0.1", port), 1).close()
                break
            except OSError:
                time.sleep(0.1)
        yield {
            "FSSPEC_S3_ENDPOINT_URL": f"http://127.0.0.1:{port}",
            "AWS_ACCESS_KEY_ID": "test",
            "AWS_SECRET_ACCESS_KEY": "test",
            "AWS_DEFAULT_REGION": "us-east-1",
        }
    finally:
        server.terminate()
        server.wait()


def test_a_store_gives_the_bytes_of_a_folder(recordings, store, tmp_path):
    copy = (
        "import fsspec, sys\n"
        "fs = fsspec.filesystem('s3')\n"
        "if sys.argv[1] == 'put':\n"
        "    fs.mkdir('robots')\n"
        "    fs.put(sys.argv[2], 'robots/recordings', recursive=True)\n"
        "else:\n"
        "    fs.get('robots/models/', sys.argv[2], recursive=True)\n"
    )
    for_copy = {"env": {**os.environ, **store}, "check": True, "timeout": PATIENCE}
    subprocess.run([sys.executable, "-c", copy, "put", f"{recordings}/"], **for_copy)
    code, out, err = fleet("s3://robots/recordings", "--out", "s3://robots/models", *FAST, env=store)
    assert code == 0, err
    code, out, err = fleet("s3://robots/recordings", "--out", "s3://robots/models", *FAST, env=store)
    assert code == 0 and out.count(" kept") == 8, out + err
    subprocess.run([sys.executable, "-c", copy, "get", f"{tmp_path}/store"], **for_copy)
    assert fleet(recordings, "--out", tmp_path / "here", *FAST)[0] == 0
    assert files(tmp_path / "store") == files(tmp_path / "here")
