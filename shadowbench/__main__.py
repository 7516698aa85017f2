"""The program `shadowbench`, also run by `python -m shadowbench`."""

import sys


def main() -> None:
    """Entry point: the command line; Ctrl-C ends it without a traceback, also while modules are imported."""
    try:
        from shadowbench.commands import main as command_line

        command_line()
    except KeyboardInterrupt:
        sys.exit(130)


if __name__ == "__main__":
    main()
