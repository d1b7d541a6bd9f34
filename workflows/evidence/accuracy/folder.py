"""The folder of accuracy studies: a table for all, where each command adds or renews its own."""

from json import dumps, loads

from workflows.evidence.accuracy.machine import machine
from workflows.evidence.accuracy.row import Row
from workflows.evidence.accuracy.rows import table_of
from workflows.files.run_folder import RunFolder
from workflows.report import finding
from workflows.report.finding import Finding

FILES = (*finding.files("accuracy"), "machine.json")


def write(found: dict[str, Finding], folder: RunFolder) -> None:
    """Tables and figures of the studies by name; those of other studies stay beside them."""
    here = machine()._asdict()
    with folder.held(*FILES):
        records = _earlier(folder) | {
            name: finding.record(one, machine=here) for name, one in found.items()
        }
        rows = tuple(Row(**row) for one in records.values() for row in one["rows"])
        sentences = tuple(said for one in records.values() for said in one["findings"])
        new = finding.merged(found.values())
        every = new._replace(tables=(table_of(rows), *new.tables[1:]), sentences=sentences)
        finding.write(every, folder, machine=here, studies=records)
        folder.write("machine.json", dumps(here, indent=1) + "\n")


def _earlier(folder: RunFolder) -> dict[str, dict]:
    """What other commands left in the folder, by study."""
    if not folder.ours("accuracy.json"):
        return {}
    return loads((folder.path / "accuracy.json").read_text(encoding="utf-8"))["studies"]
