"""One file that an option names: replaced only where beadwave wrote it and nobody changed it since.

A note in the user's cache, named by the digest of the file's path, holds the sha256 of what was
written there; nothing is written next to the file. A file without a note is taken for the user's.
"""

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from hashlib import sha256
from os import fsencode
from os.path import isdir, isfile, lexists
from pathlib import Path

from beadwave.workflows.files.cache_folder import cache_folder, own_folders
from beadwave.workflows.files.whole_file import among, digest, unfit, writing_file
from beadwave.workflows.scene import InvalidScene


class OutputFile:
    """A file to write once its content is there; raises InvalidScene where it cannot be."""

    def __init__(
        self, path: str | Path, option: str = "--out", *, inputs: tuple[Path, ...] = (),
        ending: str = "", overwrite: bool = False,
    ) -> None:  # fmt: skip
        self.path = Path(path)
        self._named = f"{option} {path}"
        self._inputs = inputs
        self._overwrite = overwrite
        if not self.path.name.endswith(ending):
            raise InvalidScene(f"{self._named} must end in {ending}.")
        self._require_free()

    @contextmanager
    def writing(self) -> Iterator[Path]:
        """A path to write to, renamed to the file, or to what a link leads to, once complete."""
        self._require_free()
        with writing_file(self.path.resolve()) as draft:
            yield draft
            # noted before the file appears; without a usable cache the file counts as the user's
            content = digest(draft)
            with suppress(OSError):
                note, noted = _note_of(self.path), _noted(self.path)
                if content not in noted and not own_folders(cache_folder(), note.parent):
                    with note.open("a", encoding="ascii", newline="\n") as file:
                        # the first break ends a line that a killed process left half
                        file.write(f"\n{content}\n")

    def _require_free(self) -> None:
        """Raise InvalidScene for an input, for what cannot be a file, and for a file that beadwave
        did not write, or that was changed since."""
        path, named = self.path, self._named
        if among(path, self._inputs):
            raise InvalidScene(f"{named} would overwrite what is read; choose another.")
        if why := unfit(path.absolute().parent):
            raise InvalidScene(f"{named} cannot be a file ({why}); choose another.")
        if lexists(path) and not isfile(path):
            why = "it is a folder" if isdir(path) else "it is no ordinary file"
            raise InvalidScene(f"{named} cannot be written, {why}; choose another.")
        if isfile(path) and not (self._overwrite or digest(path) in _noted(path)):
            raise InvalidScene(
                f"{named} is there, and beadwave did not write it or it was changed since; choose "
                "another, or replace it by --overwrite."
            )


def output_files(
    given: dict[str, str | Path | None], *, inputs: tuple[Path, ...], overwrite: bool
) -> dict[str, OutputFile]:
    """Those of the options that name a file; raises InvalidScene where two name the same."""
    files: dict[str, OutputFile] = {}
    for option, path in given.items():
        if path is None:
            continue
        for earlier, file in files.items():
            if Path(path).resolve() == file.path.resolve():
                raise InvalidScene(f"{earlier} and {option} both name {path}; name two files.")
        files[option] = OutputFile(path, option, inputs=inputs, overwrite=overwrite)
    return files


def _noted(path: Path) -> set[str]:
    """Digests of what beadwave has written to a path; none where the folder of notes may be
    written by others, who could note anything."""
    with suppress(OSError, ValueError):
        note = _note_of(path)
        if not own_folders(cache_folder(), note.parent):
            return set(note.read_text(encoding="ascii").split())
    return set()


def _note_of(path: Path) -> Path:
    return cache_folder() / "written" / sha256(fsencode(path.resolve())).hexdigest()
