"""The entry point of `drift-drake`: Ctrl-C and SIGTERM end it in one line while the commands are still imported too."""

import sys

from drift_drake.interruption import ended_at_once


def main() -> int:
    """Runs the command line; returns its exit code."""
    with ended_at_once("drift-drake"):
        from drift_drake import cli
    return cli.main()


if __name__ == "__main__":
    sys.exit(main())
