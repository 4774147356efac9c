"""The laws of the middleware, on a real master."""

import os
import sys

from harness import Group, Process

group = Group()


@group.case
def the_backend_obeys_the_laws_of_every_middleware(_):
    with Process(os.environ["ROSCAUSAL_LAWS"], "--nocapture", env={"ROSCAUSAL_ROS1_TESTS": "1"}) as laws:
        code = laws.ended(120)
        assert code == 0 and "NOT TESTED" not in laws.text and "1 passed" in laws.text, laws.text[-2000:]


if __name__ == "__main__":
    sys.exit(group.run(node=False) > 0)
