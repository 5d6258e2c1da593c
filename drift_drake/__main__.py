"""The entry point of `drift-drake`: Ctrl-C and SIGTERM end it in one line while the commands are still imported too."""

import sys

from drift_drake.common.interruption import ended_at_once, leave_ends_to_the_system, stand_in_for_closed_streams


def main() -> int:
    """Runs the command line; returns its exit code."""
    closed = stand_in_for_closed_streams()
    if closed is not None:
        return closed
    with ended_at_once():
        from drift_drake.cli.main import main as cli
    code = cli()
    leave_ends_to_the_system()
    return code


if __name__ == "__main__":
    sys.exit(main())
