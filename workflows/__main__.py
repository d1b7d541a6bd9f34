"""`python -m workflows` is the `beadwave` command."""

import sys


def main() -> None:
    """Run the command; Ctrl-C while the program still loads is as quiet as later."""
    try:
        from workflows.cli import main as command

        command()
    except KeyboardInterrupt:
        print("beadwave: interrupted.", file=sys.stderr)
        sys.exit(130)


if __name__ == "__main__":
    main()
