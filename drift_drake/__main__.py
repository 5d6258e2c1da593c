"""The entry point of `drift-drake`: Ctrl-C and SIGTERM end it in one line while the commands are still imported too."""

import sys

from drift_drake.common.interruption import ended_at_once, leave_ends_to_the_system, stand_in_for_closed_streams


def main() -> int:
    """Runs the command line; returns its exit code."""
    leave_ends_to_the_system()  # Python's own answer to Ctrl-C is a traceback
    closed = stand_in_for_closed_streams()
    if closed is not None:
        return closed
    with ended_at_once():  # until the command line answers by itself, and once it no longer does
        from drift_drake.cli.main import main as cli

        return cli()


if __name__ == "__main__":
    sys.exit(main())
