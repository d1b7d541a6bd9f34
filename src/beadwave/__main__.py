"""`python -m beadwave` is the command `beadwave`."""

import gc
import os
import sys
from collections.abc import Callable


def main() -> None:
    """Run the command and end the process: signals stay ignored until the interpreter is gone. A
    signal while the program still loads is as quiet as later."""
    if sys.stderr is None:  # closed by the shell: print would write to stdout instead
        sys.stderr = open(os.devnull, "w", encoding="utf-8", newline="\n")
    try:
        from beadwave.workflows.commands import interrupts as signals

        signals.end_at_once()
        command = _loaded()
    except KeyboardInterrupt:
        print("beadwave: interrupted.", file=sys.stderr)
        sys.exit(130)
    try:
        signals.unwind()
        command()
    except signals.Stopped as stopped:
        signals.ignore()
        sys.exit(signals.print_end(stopped.number))
    finally:
        signals.ignore()


def _loaded() -> Callable[[], None]:
    """The command, whose modules live as long as the process: no garbage is looked for in them."""
    gc.disable()
    try:
        from beadwave.workflows.commands.app import main as command

        gc.freeze()
    finally:
        gc.enable()
    return command


if __name__ == "__main__":
    main()
