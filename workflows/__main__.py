"""`python -m workflows` is the `beadwave` command."""

import sys


def main() -> None:
    """Run the command; a signal while the program still loads is as quiet as later."""
    try:
        from workflows.commands import signals

        signals.end_at_once()
        from workflows.commands.app import main as command
    except KeyboardInterrupt:
        print("beadwave: interrupted.", file=sys.stderr)
        sys.exit(130)
    try:
        signals.unwind()
        command()
    except signals.Stopped as stopped:
        signals.ignore()
        sys.exit(signals.told(stopped.number))
    finally:
        signals.ignore()


if __name__ == "__main__":
    main()
