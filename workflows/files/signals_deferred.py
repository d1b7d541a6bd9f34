"""Signals that end the program are deferred while files are replaced."""

from collections.abc import Iterator
from contextlib import contextmanager
from signal import SIG_DFL, SIGINT, SIGTERM, raise_signal, signal
from threading import current_thread, main_thread

from beadwave import system

# the last one repeats one that was lost
ENDING = system.existing(SIGINT, SIGTERM, system.HANGUP, system.BREAK, system.REPEATS)


@contextmanager
def signals_deferred() -> Iterator[None]:
    """A block after which such a signal that came meanwhile takes effect; only the main thread
    receives any."""
    if current_thread() is not main_thread():
        yield
        return
    came: list[int] = []
    handlers = {number: signal(number, lambda n, _: came.append(n)) for number in ENDING}
    try:
        yield
    finally:
        for number, handler in handlers.items():
            signal(number, SIG_DFL if handler is None else handler)
        for number in came[:1]:
            raise_signal(number)
