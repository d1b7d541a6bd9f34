"""A module of ours run in a child process: if it crashes or hangs, this process gets a status.

The child imports nothing from the working directory, ends itself when its time is over or whoever
started it is gone, and dumps no core. What runs in it is
`python -m beadwave.workflows.files.child SECONDS MODULE ...`.
"""

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from signal import ITIMER_REAL as ITIMER_REAL
from signal import SIGALRM, setitimer
from subprocess import DEVNULL, CompletedProcess, Popen, TimeoutExpired, run
from threading import Thread


def child(module: str, *arguments: str, seconds: float) -> CompletedProcess[bytes]:
    """What `python -m module arguments` left: exit status, stdout and stderr.

    Raises TimeoutError where it took longer. A negative status is the signal that killed it.
    """
    command = _command(seconds, module, *arguments)
    try:
        with _lifeline() as end:
            # a child may take 5 s longer to end itself
            ended = run(command, capture_output=True, stdin=end, timeout=seconds + 5.0, check=False)
    except TimeoutExpired:
        raise TimeoutError(f"{module} took more than {seconds:g} s") from None
    if ended.returncode == -SIGALRM:
        raise TimeoutError(f"{module} took more than {seconds:g} s")
    return ended


@contextmanager
def while_open(module: str, *arguments: str) -> Iterator[Popen]:
    """`python -m module arguments` while the context lasts; what still runs then is killed."""
    with _lifeline() as end:
        process = Popen(_command(0, module, *arguments), stdin=end, stdout=DEVNULL, stderr=DEVNULL)
        try:
            yield process
        finally:
            process.kill()
            process.wait()


def _command(seconds: float, module: str, *arguments: str) -> list[str]:
    return [
        sys.executable, "-P", "-m", "beadwave.workflows.files.child", str(seconds), module,
        *arguments,
    ]  # fmt: skip


@contextmanager
def _lifeline() -> Iterator[int]:
    """The end of a pipe, for a child to read, that is closed however this process ends."""
    read_end, write_end = os.pipe()
    try:
        yield read_end
    finally:
        os.close(read_end)
        os.close(write_end)


def _end_with_the_parent() -> None:
    """Wait for the end of the pipe, which comes when the parent ends, and end this process."""
    os.read(0, 1)
    os._exit(1)


def main() -> None:
    """Run the module named on the command line for as long as it may."""
    from resource import RLIMIT_CORE, setrlimit
    from runpy import run_module

    seconds, module, *arguments = sys.argv[1:]
    setitimer(ITIMER_REAL, float(seconds))  # 0: without an end
    Thread(target=_end_with_the_parent, daemon=True).start()
    setrlimit(RLIMIT_CORE, (0, 0))
    sys.argv = [module, *arguments]
    run_module(module, run_name="__main__", alter_sys=True)


if __name__ == "__main__":
    main()
