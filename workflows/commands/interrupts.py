"""Signals that end the program: one sentence, the status of the signal, nothing left half written.

Nothing slow is imported here: this comes before everything else.
"""

import os
import signal
import sys
from threading import Event, Thread
from types import FrameType

from beadwave import system

WORDS = {
    signal.SIGINT: "interrupted",
    system.BREAK: "interrupted, or its terminal is gone",
    signal.SIGTERM: "terminated",
    system.HANGUP: "its terminal is gone",
}
WORDS = {number: WORDS[number] for number in system.existing(*WORDS)}
AGAIN = 0.5  # s until Stopped is raised again, where a bare `except` of a library swallowed it
PATIENCE = 10.0  # s until the process ends without unwinding, inside a long compiled calculation
_unwinding = Event()


class Stopped(BaseException):
    """Unwinds the program at the signal `number`."""

    def __init__(self, number: int) -> None:
        super().__init__(number)
        self.number = number


class Again:
    """Raises Stopped again and again, until the program unwinds."""

    def __init__(self, number: int) -> None:
        self.number = number

    def __call__(self, *_) -> None:
        raise Stopped(self.number)


def end_at_once() -> None:
    """While the program loads there is nothing to unwind: signals end it on the spot."""
    _handle(_leave)


def unwind() -> None:
    """From now on signals raise Stopped, so that files half written go and children end."""
    sys.unraisablehook = _silent
    system.ended_by_us.set()
    _handle(_raise)
    # Python runs a handler between two of its own instructions, so never inside one compiled march
    # or mesh; the byte that C writes at once wakes a thread that ends the process in its stead
    reading = system.woken_by_signals()
    Thread(target=_end_if_busy, args=(reading, PATIENCE), daemon=True).start()


def ignore() -> None:
    """Ignore signals from now on: the program has ended but for the interpreter's own clean-up."""
    system.end_repeats()
    _handle(signal.SIG_IGN)


def stopped_by(error: BaseException | None) -> int | None:
    """The signal behind an exception: also where a library raised another exception from it, or
    where it was lost in a callback from C and the library failed because of that."""
    handler = signal.getsignal(system.REPEATS)
    if error is not None and isinstance(handler, Again):
        return handler.number
    while error is not None:
        if isinstance(error, Stopped):
            return error.number
        error = error.__cause__ or error.__context__
    return None


def print_end(number: int) -> int:
    """Print the sentence of a signal; its exit status."""
    line = f"beadwave: {WORDS[number]}; finished stages are kept, the same command goes on.\n"
    os.write(2, line.encode())
    return 128 + number


def _handle(handler) -> None:
    """Give the signals that end a command a handler, but for those that its starter ignores."""
    for number in WORDS:
        if signal.getsignal(number) != signal.SIG_IGN:  # as nohup and a shell's & set it
            signal.signal(number, handler)


def _leave(number: int, frame: FrameType | None) -> None:
    os._exit(print_end(number))


def _end_if_busy(reading: int, patience: float) -> None:
    """End the process at the first signal whose handler has not run after `patience` seconds: as a
    kill would, where what is half written stays under another name."""
    while number := os.read(reading, 1):
        if number[0] in WORDS and signal.getsignal(number[0]) is not signal.SIG_IGN:
            if not _unwinding.wait(patience):
                os._exit(print_end(number[0]))
            return


def _raise(number: int, frame: FrameType | None) -> None:
    _unwinding.set()
    for other in WORDS:
        signal.signal(other, signal.SIG_IGN)
    again = Again(number)
    system.repeat(again, AGAIN)
    again()


def _silent(unraisable) -> None:
    """Hook for exceptions that cannot propagate: a Stopped is raised again later, so nothing is
    printed; any other exception is printed as usual."""
    if stopped_by(unraisable.exc_value) is None:
        sys.__unraisablehook__(unraisable)
