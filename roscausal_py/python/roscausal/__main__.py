"""The command `roscausal`, also as `python -m roscausal`."""

import signal
import sys

from ._native import command


def main() -> int:
    """Runs the command with the arguments of this process.

    Returns:
        The exit code: 0 finished, 1 failure, 2 wrong usage.
    """
    # The command has its own handling of Ctrl-C.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    return command(["roscausal", *sys.argv[1:]])


if __name__ == "__main__":
    sys.exit(main())
