"""All tests; an argument runs only those with it in their name."""

import sys

import harness

import wire  # noqa: F401
import behaviour  # noqa: F401

for module in ("pipeline", "cyclone"):
    try:
        __import__(module)
    except ModuleNotFoundError as missing:
        print(f"NOT TESTED: {module} ({missing})")

sys.exit(harness.main(sys.argv[1] if len(sys.argv) > 1 else ""))
