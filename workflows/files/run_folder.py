"""Run folders: every file is complete or absent, and files of other origin are never touched.

The marker `.beadwave` of a folder lists the files that were written into it with their sha256, each
line before its file appears. A run may replace and clear files that are listed and unchanged, no
others. A lock, which ends with its process, keeps two runs from one folder.
"""

from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager, nullcontext, suppress
from os import getpid, replace
from os.path import expanduser, isdir, isfile, islink, lexists
from pathlib import Path
from re import fullmatch
from shutil import rmtree
from typing import NamedTuple

from beadwave.system import file_name, held_open, is_shared, locked, runs
from beadwave.workflows.files.output_file import OutputFile
from beadwave.workflows.files.signals_deferred import signals_deferred
from beadwave.workflows.files.whole_file import (
    among,
    clear_parts,
    digest,
    unfit,
    writing_file,
)
from beadwave.workflows.scene import InvalidScene, nearest

MARKER = ".beadwave"
LOCK = ".beadwave.lock"  # empty, there while a run writes
NEW = ".beadwave-new-"  # and the number of the process that fills it
HEAD = "# What beadwave wrote here, with its sha256; the next run clears what is unchanged.\n"
# of a marker; a killed run leaves half a line
LINE = r"|#.*|[0-9a-f]{1,64}|[0-9a-f]{64} .*"


class Picture(NamedTuple):
    """A PNG, for `figures/` or a notebook, which shows it."""

    name: str
    png: bytes

    def save(self, path: str | Path, *, overwrite: bool = False) -> Path:
        """Write it to a file; raises InvalidScene for one that beadwave did not write."""
        with OutputFile(path, "the picture", overwrite=overwrite).writing() as draft:
            draft.write_bytes(self.png)
        return Path(path)

    def _repr_png_(self) -> bytes:
        return self.png

    def __repr__(self) -> str:
        return f"<picture {self.name}, {len(self.png)} bytes of PNG>"


class NoPicture(RuntimeError):
    """Pictures could not be rendered; the message says what to install."""


class RunFolder:
    """A folder that is written to. Files of `inputs` are never replaced, those that beadwave did
    not write only with `overwrite`."""

    def __init__(
        self,
        path: Path,
        *,
        inputs: tuple[Path, ...] = (),
        overwrite: bool = False,
        base: "RunFolder | None" = None,
    ) -> None:
        self.path = path
        self.base = base or self  # where it stands in the end
        self._inputs = inputs
        self._overwrite = overwrite
        self._written: set[str] = set()  # of the result
        self._new: set[str] = set()  # all that was written, parts of a result included

    @contextmanager
    def run(self, scene_toml: str, files: Iterable[str] = ()) -> Iterator["RunFolder"]:
        """The folder into which a run of this scene writes these files.

        Where an earlier run has left files, it is a new folder inside of this one, whose files
        replace the earlier ones when the run has ended. Otherwise it is this folder itself; a run
        that is refused leaves it as it was.
        """
        is_new, has_marker = not lexists(self.path), lexists(self.path / MARKER)
        same = self.ours("scene.toml") and _text(self.path / "scene.toml") == scene_toml
        try:
            with self.held(*(() if same else ("scene.toml",)), *files):
                over = any(map(self.ours, self._noted()))
                try:
                    with self._inside_of() if over else nullcontext(self) as folder:
                        folder.write("scene.toml", scene_toml)
                        yield folder
                        self._take(folder)
                except InvalidScene:
                    # what was written since the start goes, and marker and folder if made for that
                    self.clear(self._new)
                    with suppress(OSError):
                        (self.path / "figures").rmdir()
                    if not has_marker:
                        (self.path / MARKER).unlink(missing_ok=True)
                    raise
        except InvalidScene:
            if is_new:
                with suppress(OSError):  # one that holds the lock or files of another run is left
                    self.path.rmdir()
            raise

    @contextmanager
    def _inside_of(self) -> Iterator["RunFolder"]:
        """A folder in this one that is removed at the end; those of killed runs are removed
        first."""
        for path in self.path.glob(f"{NEW}*"):
            process = path.name.removeprefix(NEW)
            if process.isdecimal() and not runs(int(process)):
                rmtree(path, ignore_errors=True)
        new = self.path / f"{NEW}{getpid()}"
        try:
            yield RunFolder(new, base=self)
        finally:
            rmtree(new, ignore_errors=True)

    def _take(self, new: "RunFolder") -> None:
        """Put the files of a new folder in the place of those of ours.

        Everything that can be refused is refused before the first file moves; then the marker notes
        a file before it appears, so that a run killed in between leaves none of unknown origin.
        """
        arrived = () if new is self else tuple(new._noted())
        # a file that stands here with this very content stays
        moved = [
            name for name in arrived
            if not (self.ours(name) and digest(self.path / name) == digest(new.path / name))
        ]  # fmt: skip
        for name in moved:
            self._require_no_input(name)
            self._require_ours(name)
        cleared = self._clearable(self._noted().keys() - new._written - {*arrived})
        for name in (*moved, *cleared):
            if held_open(self.path / name):
                raise InvalidScene(
                    f"--out {self.path} holds {name}, which another program has open; close it "
                    "there and repeat the command."
                )
        for name in moved:
            self._note(name, new.path / name)
            (self.path / name).parent.mkdir(exist_ok=True)
        with signals_deferred():  # each file is whole at any instant, all are new within some ms
            for name in moved:
                replace(new.path / name, self.path / name)
            for name in cleared:
                (self.path / name).unlink()

    @contextmanager
    def renewed(self, *files: str) -> Iterator["RunFolder"]:
        """The folder for a result without a resolved scene: at the end, files of ours that were not
        written again are removed."""
        with self.held(*files):
            yield self
            self.clear(self._noted().keys() - self._written)

    def require(self, *files: str) -> None:
        """Raise InvalidScene where the folder cannot be one, or one of these files is not ours."""
        path = checked_folder(self.path)

        # no folder of the system, no home, none whose marker would be waited for (a pipe), leads to
        # another file (a link) or is of other origin
        place = path.resolve()
        if is_shared(place):
            raise InvalidScene(
                f"--out {path} is a folder of the system; choose one for the run alone."
            )
        if lexists(path / MARKER) and not marked(path):
            kind = "a symbolic link" if islink(path / MARKER) else "no ordinary file"
            raise InvalidScene(
                f"--out {path} holds {MARKER}, which is {kind}; remove it or choose another folder."
            )
        if not all(fullmatch(LINE, line) for line in (_text(path / MARKER) or "").splitlines()):
            raise InvalidScene(
                f"--out {path} holds {MARKER}, which beadwave did not write; remove it or choose "
                "another folder."
            )
        lock = path / LOCK
        if lexists(lock) and (islink(lock) or not isfile(lock) or lock.stat().st_size):
            raise InvalidScene(
                f"--out {path} holds {LOCK}, which beadwave did not write; remove it or choose "
                "another folder."
            )
        if place == Path(expanduser("~")).resolve() and not marked(path):
            raise InvalidScene(
                f"--out {path} is your home folder; choose one in it for the run alone."
            )

        for folder in {(self.path / name).parent for name in files}:
            checked_folder(folder)
        for name in files:
            self._require_no_input(name)
        for name in files:
            self._require_ours(name)

    @contextmanager
    def held(self, *files: str) -> Iterator["RunFolder"]:
        """The folder, closed to other runs; raises InvalidScene where these files cannot be."""
        self.require(*files)
        with ExitStack() as held:
            try:
                self.make()
                held.enter_context(locked(self.path / LOCK))
                (self.path / MARKER).touch()
                clear_parts(self.path, self.path / "figures")
            except BlockingIOError:
                raise InvalidScene(
                    f"--out {self.path} is being written by another run; wait for it or choose "
                    "another."
                ) from None
            except OSError as error:
                raise InvalidScene(
                    f"--out {self.path} cannot be written ({error.strerror}); choose another."
                ) from None
            yield self

    def clear(self, names: Iterable[str]) -> None:
        """Remove these files as far as they are ours and no input."""
        for name in self._clearable(names):
            (self.path / name).unlink()

    def _clearable(self, names: Iterable[str]) -> list[str]:
        """Those of these names that are files of ours and no inputs."""
        return [
            name for name in names
            if self.ours(name) and not among(self.path / name, self._inputs)
        ]  # fmt: skip

    def keep(self, names: Iterable[str]) -> None:
        """Count files of an earlier run as written by this one, so that they stay."""
        self._written.update(names)

    def leave(self, names: Iterable[str]) -> None:
        """Count files as not written by this run, so that they are removed at its end."""
        self._written.difference_update(names)

    def find(self, name: str) -> Path:
        """The file of this run, or the one that it keeps of an earlier run."""
        path = self.path / name
        return path if isfile(path) else self.base.path / name

    def make(self) -> None:
        """Make the folder; raises InvalidScene where it cannot be one."""
        try:
            self.path.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InvalidScene(
                f"--out {self.path} cannot be a folder ({error.strerror}); choose another."
            ) from None

    @contextmanager
    def writing(self, name: str) -> Iterator[Path]:
        """A path to write to, renamed to the file once it is complete."""
        self._require_no_input(name)
        self._require_ours(name)
        with writing_file(self.path / name) as draft:
            yield draft
            self._note(name, draft)

    def write(self, name: str, content: str | bytes) -> Path:
        """Write a whole file."""
        raw = content.encode() if isinstance(content, str) else content
        if not self.ours(name) or (self.path / name).read_bytes() != raw:
            with self.writing(name) as draft:
                draft.write_bytes(raw)
        self._written.add(name)
        return self.path / name

    def _require_no_input(self, name: str) -> None:
        target = self.path / name
        if among(target, self._inputs):
            raise InvalidScene(f"--out {self.path} would overwrite {target}; choose another.")

    def _require_ours(self, name: str) -> None:
        target = self.path / name
        if isdir(target):
            raise InvalidScene(f"--out {self.path} holds {name}, a folder; choose another.")
        if lexists(target) and not (self._overwrite or self.ours(name)):
            raise InvalidScene(
                f"--out {self.path} holds {name}, which beadwave did not write or which "
                "was changed since; choose another, or replace it by --overwrite."
            )

    def ours(self, name: str) -> bool:
        """True if the file is there and as we wrote it: a run killed while it replaced a file has
        left the marker with both contents, of which either is ours."""
        digests = self._noted().get(name)
        return bool(digests) and isfile(self.path / name) and digest(self.path / name) in digests

    def _noted(self) -> dict[str, set[str]]:
        """Digests of what was written, by name; half a line is of a run that was killed."""
        noted: dict[str, set[str]] = {}
        for line in (_text(self.path / MARKER) or "").splitlines():
            note = fullmatch(r"([0-9a-f]{64})  (.+)", line)
            if note and self._inside(note[2]):
                noted.setdefault(note[2], set()).add(note[1])
        return noted

    def _inside(self, name: str) -> bool:
        """True if a name leads to a place in the folder: anybody may write a marker."""
        folder = self.path.resolve()
        return (folder / name).parent.resolve().is_relative_to(folder)

    def _note(self, name: str, draft: Path) -> None:
        """Add a file that is about to appear to the marker."""
        content = digest(draft)
        self._written.add(name)
        self._new.add(name)
        if content in self._noted().get(name, ()):
            return
        with (self.path / MARKER).open("a", encoding="utf-8", newline="\n") as marker:
            # the line break before it ends a line that a killed run left half
            marker.write(("" if marker.tell() else HEAD) + f"\n{content}  {name}\n")


def checked_folder(path: Path) -> Path:
    """The path of a folder to make later; raises InvalidScene where it cannot be one."""
    if why := unfit(path.absolute()):
        raise InvalidScene(f"--out {path} cannot be a folder ({why}); choose another.")
    return path


def marked(folder: Path) -> bool:
    """True if beadwave filled the folder: its marker is a regular file."""
    return isfile(folder / MARKER) and not islink(folder / MARKER)


def _text(path: Path) -> str | None:
    return path.read_bytes().decode(errors="replace") if isfile(path) else None


def write_pictures(folder: RunFolder, pictures: tuple[Picture, ...]) -> None:
    """Write each picture to `figures/`."""
    for picture in pictures:
        folder.write(f"figures/{file_name(picture.name)}.png", picture.png)


def picture_named(pictures: Iterable[Picture], name: str | None) -> Picture:
    """The picture of the name, the first without one; raises InvalidScene where there is none."""
    by_name = {picture.name: picture for picture in pictures}
    if not by_name:
        raise InvalidScene("there is no picture of this result.")
    if name is not None and name not in by_name:
        raise InvalidScene(f"no picture {name!r}; {nearest(name, by_name)}.")
    return by_name[next(iter(by_name)) if name is None else name]
