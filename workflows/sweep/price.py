"""What a sweep will take, from its first cases."""

from time import perf_counter
from typing import NamedTuple

from workflows.pipeline.pipeline import pipeline_of
from workflows.results.tables import Table
from workflows.sweep.cases import Base, checked, groups
from workflows.sweep.design import Design
from workflows.sweep.march import Prepared, models, models_key, prepared, rows

TRIED = 64  # cases side by side that are timed, or one alone
SIZE = 8e-9  # GB of a number


class Price(NamedTuple):
    """Cases and what they share, seconds and memory to expect."""

    cases: int
    refused: int
    walls: int
    models: int  # reduced models of assemblies
    models_missing: int  # of these, not kept from earlier
    side_by_side: int  # cases that the batch takes
    seconds_case: float
    seconds_model: float
    workers: int
    seconds: float
    memory_GB: float  # of each process, beyond what the program takes

    def table(self) -> Table:
        """For a person and for machines."""
        labels = (
            "cases", "refused", "walls", "reduced models", "reduced models to compute",
            "cases side by side", "seconds a case", "seconds a reduced model", "processes",
            "seconds", "memory of a process [GB]",
        )  # fmt: skip
        return Table("price", ("", "to expect"), tuple(zip(labels, self, strict=True)))


def price(base: Base, design: Design, workers: int) -> Price:
    """Timed on the first cases and on the first reduced model that is missing, which are kept."""
    looked = [checked(base, group) for group in groups(base, design, list(range(design.n_cases)))]
    walls = [one for one in looked if one.scene is not None]
    keys = {key: one.scene for one in walls if (key := models_key(one.scene))}
    missing = [scene for scene in keys.values() if not _kept(scene)]
    started = perf_counter()
    if missing:
        models(missing[0])
    seconds_model = perf_counter() - started if missing else 0.0
    seconds_case = _seconds_case(walls[0]) if walls else 0.0
    refused = sum(len(one.refused) for one in looked)
    run = seconds_case * (design.n_cases - refused) + seconds_model * max(0, len(missing) - 1)
    joined = sum(len(one.sound.cases) for one in walls if one.joins)
    return Price(
        design.n_cases, refused, len(walls), len(keys), len(missing), joined, seconds_case,
        seconds_model, workers, run / workers, _memory(walls[0]) if walls else 0.0,
    )  # fmt: skip


def _kept(scene) -> bool:
    pipeline = pipeline_of(scene, lambda name: None)
    return pipeline.kept("reduction") and pipeline.kept("coarse-reduction")


def _seconds_case(one) -> float:
    shared = prepared(one.scene, models(one.scene) if models_key(one.scene) else None)
    if not isinstance(shared, Prepared) or shared.failure:
        return 0.0
    some = next(one.parts(TRIED if one.joins else 1))
    rows(some, shared, False)  # compiles
    started = perf_counter()
    rows(some, shared, False)
    return (perf_counter() - started) / len(some.group.cases)


def _memory(one) -> float:
    from workflows.sweep.sweep import CHUNK

    scene = one.scene
    per_case = scene.output.samples * (len(scene.output.spheres) + 1)
    return SIZE * 3 * per_case * (CHUNK if one.joins else 1)
