"""Where ``etac`` begins: nothing heavy is imported yet, so that an interrupt has an answer from the start."""

from __future__ import annotations

import sys

INTERRUPTED = 130


def main() -> None:
    """Import the commands and run the one that is asked for."""
    try:
        from etac_ros.cli.main import main as command

        command()
    except KeyboardInterrupt:
        print("etac: interrupted", file=sys.stderr)
        sys.exit(INTERRUPTED)
