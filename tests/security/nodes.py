"""The whole chain with DDS Security: `nodes.py PROGRAM`: a simulator and four nodes, each a process of its own in an
enclave of one keystore; models must come out. Beside them a recorder without a certificate, which must record nothing.
"""

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

here = Path(__file__).parent
sys.path.insert(0, str(here.parent / "soak"))
from faults import NODES, Processes, account, command, parameters, rows_after  # noqa: E402


def run(program, folder):
    keystore = folder / "keystore"
    subprocess.run(["sh", here / "keystore.sh", keystore, "/roscausal"], check=True)
    base = {"ROS_DOMAIN_ID": str(10 + os.getpid() % 80), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    secure = {"ROS_SECURITY_ENABLE": "true", "ROS_SECURITY_STRATEGY": "Enforce", "ROS_SECURITY_KEYSTORE": str(keystore)}
    with Processes(folder) as processes:
        given = parameters(folder)
        spy = {**given["data"], "data_dir": folder / "spy", "pp_data_dir": folder / "spy_pp"}

        def start(name, node, values, env, *more):
            processes.start(name, command("ros2", program, node, values, *more), {**base, **env})

        for name in NODES + ["hrisim"]:
            start(name, name, given[name], secure, "--enclave", "/roscausal")
        begin = time.time()
        # It would accept the robot's and the people's states as they are, in the clear.
        start("spy", "data", spy, {}, "-r", "__node:=spy")
        processes.wait_for(lambda: rows_after(folder, begin), 60, "a first batch")
        processes.wait_for(lambda: len(list((folder / "models").glob("*.json"))) >= 3, 60, "three models")
        caught = list((folder / "spy").glob("*.csv"))
        assert not caught, "without a certificate it recorded %s" % caught
        # With a certificate the same recorder records, which shows that the certificate makes the difference.
        processes.end("spy")
        start("spy", "data", spy, secure, "-r", "__node:=spy", "--enclave", "/roscausal")
        processes.wait_for(lambda: list((folder / "spy").glob("data_*.csv")), 60, "a batch of the spy's, now with a certificate")
        for name in ["hrisim", "spy", *NODES]:
            processes.end(name)
        # Once in some thousand starts the library deadlocks, and the node restarts after ten seconds.
        account(folder, begin, late=45)


if __name__ == "__main__":
    with tempfile.TemporaryDirectory(prefix="roscausal-secure-") as folder:
        try:
            run(os.path.abspath(sys.argv[1]), Path(folder))
        except AssertionError as error:
            sys.exit("FAIL: %s" % error)
