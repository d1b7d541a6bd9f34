"""Foreign binary files, read in a process of their own: each ends in arrays or in a sentence.

Libraries that parse MATLAB's, HDF5, mesh or STEP files crash on some damaged ones and hang on
others. A reader's child is given time by the size of the file; its result is an .npz without
pickles.
"""

from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TypeVar

import numpy as np

from beadwave.system import crash, free_memory, worked_out
from beadwave.workflows.files.child import child
from beadwave.workflows.files.foreign_reader import REFUSED

Result = TypeVar("Result")
READER = "beadwave.workflows.files.foreign_reader"
# processor seconds to import a reader, and the fewest bytes that one reads in a second; a reader
# that takes longer is taken to hang
START, RATE = 8.0, 1e6
RATES = {"step": 5e4}  # surfaces of STEP files are intersected and healed, splines read twice
SHARE = 1 / 12  # of a processor that a busy machine leaves to the reader, at least


class Unreadable(ValueError):
    """A file on which its reader crashes or hangs; the message says which."""


class Refused(Unreadable):
    """A file that its reader refuses, with its reason."""


def require_memory(path: Path) -> None:
    """Raise Unreadable for a file that memory has no room for: as bytes and as what they say."""
    size, memory = path.stat().st_size, free_memory()
    if 2 * size > memory:
        raise Unreadable(
            f"it has {size / 1e9:.3g} GB, to be read twice that, and {memory / 1e9:.3g} GB of "
            "memory are free"
        )


def arrays(kind: str, path: Path, *names: str) -> dict[str, np.ndarray]:
    """Arrays of a file, as they are there, by the reader `kind` of `foreign_reader`, only those of
    these names where it takes names; raises Unreadable."""
    return through_child(kind, path, _content, *names)


def through_child(kind: str, path: Path, load: Callable[[Path], Result], *names: str) -> Result:
    """Result of `load` on the .npz to which a child process has converted the file; raises
    Unreadable."""
    require_memory(path)
    seconds = START + path.stat().st_size / RATES.get(kind, RATE)
    endless = Unreadable(f"reading it does not end within {seconds:.0f} s")
    # on Windows a child that was killed may have its files open for some ms
    with TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        target = Path(folder) / "result.npz"
        arguments = (str(seconds), kind, str(path.absolute()), str(target), *names)
        try:
            reader = child(READER, *arguments, seconds=seconds / SHARE)
        except TimeoutError:
            raise endless from None
        status = reader.returncode
        if worked_out(status):
            raise endless
        if status == REFUSED:
            raise Refused(target.with_suffix(".txt").read_text(encoding="utf-8").rstrip("."))
        if status != 0:
            cause = crash(status)
            end = f"crashes ({cause})" if cause else f"fails (status {status})"
            raise Unreadable(f"its reader {end}, the file is damaged")
        return load(target)


def _content(path: Path) -> dict[str, np.ndarray]:
    with np.load(path, allow_pickle=False) as archive:
        return {str(name): archive[f"value{i}"] for i, name in enumerate(archive["keys"])}
