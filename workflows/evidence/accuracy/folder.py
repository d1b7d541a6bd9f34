"""The folder of accuracy studies: a table for all, where each command adds or renews its own."""

from json import dumps, loads

from workflows.evidence.accuracy.machine import machine
from workflows.evidence.accuracy.row import AccuracyRow, table_of
from workflows.files.run_folder import RunFolder
from workflows.report import finding
from workflows.report.finding import Finding

FILES = (*finding.files("accuracy"), "machine.json")


def write(findings: dict[str, Finding], folder: RunFolder) -> None:
    """Tables and figures of the studies by name; those of other studies stay beside them."""
    about = machine()._asdict()
    with folder.held(*FILES):
        records = {}  # by study, of commands before this one and then of this one
        if folder.ours("accuracy.json"):
            text = (folder.path / "accuracy.json").read_text(encoding="utf-8")
            records = loads(text)["studies"]
        for name, study in findings.items():
            records[name] = finding.record(study, machine=about)

        rows = tuple(AccuracyRow(**row) for record in records.values() for row in record["rows"])
        sentences = tuple(text for record in records.values() for text in record["findings"])
        new = finding.merged(findings.values())
        joined = new._replace(tables=(table_of(rows), *new.tables[1:]), sentences=sentences)
        finding.write(joined, folder, machine=about, studies=records)
        folder.write("machine.json", dumps(about, indent=1) + "\n")
