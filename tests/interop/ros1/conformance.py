"""The conformance tests of the middleware, on a real master."""

import os
import sys

from harness import Group, Process

group = Group()


@group.case
def the_backend_passes_the_conformance_tests_of_every_middleware(_):
    with Process(os.environ["ROSCAUSAL_CONFORMANCE"], "--nocapture", env={"ROSCAUSAL_ROS1_TESTS": "1"}) as tests:
        code = tests.ended(120)
        assert code == 0 and "NOT TESTED" not in tests.text and "1 passed" in tests.text, tests.text[-2000:]


if __name__ == "__main__":
    sys.exit(group.run(node=False) > 0)
