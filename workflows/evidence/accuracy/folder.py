"""The folder of accuracy studies: a table for all, where each command adds or renews its own."""

import platform
from datetime import UTC, datetime
from json import dumps, loads
from os import cpu_count
from typing import Any

from beadwave.system import processor_name
from beadwave.workflows.evidence.accuracy.runs import AccuracyRow, table_of
from beadwave.workflows.files.run_folder import RunFolder
from beadwave.workflows.report import finding
from beadwave.workflows.report.finding import Finding
from beadwave.workflows.stages.engine.cache import LIBRARIES, library_versions

FILES = (*finding.files("accuracy"), "machine.json")


def machine() -> dict[str, Any]:
    """The machine that a study runs on: processor, by its model's name where the system tells it,
    system, versions, and the time (UTC) to the second."""
    return {
        "processor": processor_name(),
        "cores": cpu_count() or 1,
        "system": platform.platform(),
        "python": platform.python_version(),
        "taken": datetime.now(UTC).isoformat(timespec="seconds"),
        "libraries": library_versions(("beadwave", *LIBRARIES, "scikit-sundae")),
    }


def write(findings: dict[str, Finding], folder: RunFolder) -> None:
    """Tables and figures of the studies by name; those of other studies stay beside them."""
    about = machine()
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
