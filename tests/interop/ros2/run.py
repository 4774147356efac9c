"""Runs all tests, or those whose name contains the argument."""

import os
import sys

import harness

import wire  # noqa: F401
import behaviour  # noqa: F401
import nodes  # noqa: F401
import fleet  # noqa: F401
import load  # noqa: F401
import reasoning  # noqa: F401

for module in ("install", "pipeline", "cyclone"):
    if module != "cyclone" and "ROSCAUSAL_INSTALL" not in os.environ:
        print(f"NOT TESTED: {module} (needs what colcon has built and installed)")
        continue
    try:
        __import__(module)
    except ModuleNotFoundError as missing:
        print(f"NOT TESTED: {module} ({missing})")

sys.exit(harness.main(sys.argv[1] if len(sys.argv) > 1 else ""))
