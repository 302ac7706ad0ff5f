"""The `gentamp-lp` command, also as `python -m gentamp_lp`."""

import sys


def main() -> None:
    """Run the command; Ctrl-C ends it quietly while its parts are still being imported, too."""
    try:
        from gentamp_lp.cli.main import main as command
    except KeyboardInterrupt:
        sys.exit(130)
    command()


if __name__ == "__main__":
    main()
