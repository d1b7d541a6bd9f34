"""Measured frequency responses in and out: .csv, .uff; their content is in `fem.hammer_files`."""

from pathlib import Path

from fem.hammer_files import (
    Responses,
    data_set,
    of_data_sets,
    read_csv,
    require_finite,
    write_csv,
)
from workflows.files.output_file import OutputFile
from workflows.files.uff import ENDINGS, data_sets, pyuff
from workflows.scene import InvalidScene
from workflows.scene.named_files import require_file

HAMMER = "give a hammer test as .csv or .uff"
CSV = "a CSV needs frequency_hz, re_1, im_1, ... below a header line"
UFF = (
    "a universal file needs data sets 58; shapes alone (data set 55) are targets of modes and "
    "tune: [[targets]] with hz and shape = the file"
)


def responses(path: Path) -> Responses:
    """The responses of a file; raises InvalidScene where it holds none."""
    ending = path.suffix.lower()
    if ending not in (".csv", *ENDINGS):
        raise InvalidScene(f"{path} must end in .csv, .uff or .unv.")
    require_file(path, HAMMER)
    try:
        is_csv = ending == ".csv"
        return require_finite(read_csv(path) if is_csv else of_data_sets(data_sets(path, 58)))
    except (ValueError, KeyError, IndexError, UnicodeDecodeError) as error:
        wanted = CSV if ending == ".csv" else UFF
        raise InvalidScene(
            f"{path} holds no frequency responses that can be read ({error}); {wanted}."
        ) from None


def write_uff(path: Path, test: Responses) -> None:
    """Write as ASCII UFF58 (binary ones of this library cannot be read back)."""
    library = pyuff()
    file = library.UFF(str(path))
    for i in range(1, len(test.H) + 1):
        content = library.prepare_58(binary=0, **data_set(test, i))
        file.write_sets(content, mode="add" if i > 1 else "overwrite")


def write_synthetic(file: OutputFile, test: Responses) -> None:
    """Write a computed test, .uff or .csv."""
    write = write_csv if file.path.suffix.lower() == ".csv" else write_uff
    with file.writing() as draft:
        write(draft, test)


def synthetic_file(path: Path, overwrite: bool) -> OutputFile:
    """Where a computed test goes; raises InvalidScene where it cannot."""
    if path.suffix.lower() not in (".csv", ".uff"):
        raise InvalidScene(f"{path} must end in .csv or .uff.")
    return OutputFile(path, "FILE", overwrite=overwrite)
