"""Rows of cases without a chain: frequencies, and zone and pressure of faces in contact."""

from time import perf_counter

import numpy as np

from beadwave.fem.modes.mac import RIGID
from beadwave.workflows.stages.engine.stage_table import in_contact
from beadwave.workflows.sweep.cases import CheckedGroup, Group
from beadwave.workflows.sweep.core.case_row import DONE, FAILED, Rows, without_result
from beadwave.workflows.sweep.models import FAILURES, Source, sentence

N_MODES = 12  # the lowest elastic ones
OF_FACES = ("zone_area_m2", "pressure_max_Pa", "force_N", "stuck_share")  # of each joint


def rows_of_modes(checked: CheckedGroup, group: Group, source: Source) -> list[Rows]:
    """Rows of the cases of a group, with the columns mode_N_hz of the elastic modes by the numbers
    that `modes` gives them, NAME_zone_area_m2, ... of joints in contact, and error_mesh, the
    largest one of a frequency that is known. `source` is that of the group."""
    finished = []
    for i, number in enumerate(group.cases):
        started = perf_counter()
        try:
            scene = checked.base.with_values(group.values(i))
            pipeline = source._replace(scene=scene).pipeline
            modes = pipeline("modes")
            elastic = np.flatnonzero(modes.omega > RIGID * modes.omega.max())[:N_MODES]
            hz = modes.omega[elastic] / (2 * np.pi)
            columns = {f"mode_{j + 1}_hz": x for j, x in zip(elastic, hz.tolist(), strict=True)}
            if in_contact(scene):
                for row in pipeline("contact-numbers"):
                    columns |= {f"{row.joint}_{name}": getattr(row, name) for name in OF_FACES}
            if scene.bending is not None:
                errors = {e.name: e.relative for e in pipeline("structure-errors")}
                of_mesh = np.array([errors.get(f"mode {j + 1}", np.nan) for j in elastic])
            elif source.family is None:
                of_mesh = pipeline("missed-energy").of_frequencies(modes.omega)[elastic]
            else:
                of_mesh = source.family.mesh_error[elastic]
            columns["error_mesh"] = float(np.nanmax(np.append(of_mesh, 0.0)))
            pipeline.release()
        except FAILURES as reason:
            finished.append(without_result({}, (number,), FAILED, [sentence(reason)]))
            continue
        columns |= {"seconds": perf_counter() - started, "status": DONE, "message": ""}
        finished.append(Rows((number,), {name: [value] for name, value in columns.items()}))
    return finished
