"""Damping values of a scene that a fit to responses may vary: ratios, Rayleigh's alpha and beta,
loss factors, and dashpots parallel to springs."""

from collections.abc import Mapping, Sequence

import numpy as np

from beadwave.fem.updating.response_model import DampingParameter, StructureDamping
from beadwave.workflows.scene import InvalidScene, LossFactorsTable, Scene
from beadwave.workflows.scene import ModalDampingTable as Modal
from beadwave.workflows.scene import RayleighDampingTable as Rayleigh
from beadwave.workflows.stages.chain.damping import damping_law

RATIO = (1e-6, 0.5)  # bounds of damping ratios and, twice as large, of loss factors
ALPHA, BETA = (1e-4, 1e5), (1e-12, 1e-1)  # [1/s], [s]
DASHPOT = (1e-6, 10.0)  # of k / omega at 100 Hz
START = 0.01  # damping ratio, or loss factor, where the scene has none yet
OF_STIFFNESS = 0.01 / (2 * np.pi * 100)  # [s] dashpot over stiffness, where the scene has none


def dashpot_keys(scene: Scene) -> dict[str, tuple[float, float]]:
    """Dashpots of a scene by name, "joints.bolts.cz": their coefficient [N s/m] and the
    stiffness [N/m] parallel to them; rigid and open directions have none."""
    keys = {}
    for name, table in scene.bushings.items():
        for axis in ("x", "y", "z", "rx", "ry", "rz"):
            k = getattr(table, f"k{axis}")
            if k is not None and 0 < k < np.inf:
                keys[f"joints.{name}.c{axis}"] = (getattr(table, f"c{axis}"), k)
    for one in scene.springs or ():
        for key, k in one.stiffnesses.items():
            keys[f"springs.{one.name}.c{key[1:]}"] = (one.dashpots[key], k)
    return keys


def known_dampings(scene: Scene, parts: Sequence[str]) -> dict[str, float]:
    """Names of damping values that may be freed, and the scene's values; `parts` are those that
    have strain, "materials.steel"."""
    table, values = scene.damping, {}
    if isinstance(table, Modal):
        if isinstance(table.ratio, float):
            values["damping.ratio"] = table.ratio
        else:
            numbered = zip(scene.measured_numbers, table.ratio, strict=False)
            values |= {f"damping.ratio.{n}": ratio for n, ratio in numbered}
    elif isinstance(table, Rayleigh) and not table.frequency:
        values |= {"damping.alpha": table.alpha, "damping.beta": table.beta}
    elif isinstance(table, LossFactorsTable):
        values |= {f"damping.{part}": table.factors.get(part, 0.0) for part in parts}
    return values | {name: c for name, (c, _) in dashpot_keys(scene).items()}


def freed_dampings(
    scene: Scene, names: Sequence[str], parts: Sequence[str]
) -> list[DampingParameter]:
    """Damping parameters by name, started from the scene's values where these are not zero."""
    known, dashpots, parameters = known_dampings(scene, parts), dashpot_keys(scene), []
    for name in names:
        value = known[name]
        if name in dashpots:
            k = dashpots[name][1]
            entry, _, key = name.partition(".")[2].rpartition(".")
            beside = f"{entry}.k{key[1:]}"
            lower, upper = (factor * k / (2 * np.pi * 100) for factor in DASHPOT)
            kind, key, start = "dashpot", beside, OF_STIFFNESS * k
        elif name in ("damping.alpha", "damping.beta"):
            kind = name.partition(".")[2]
            lower, upper = ALPHA if kind == "alpha" else BETA
            key, start = "", np.sqrt(lower * upper)
        elif name.startswith("damping.ratio"):
            kind, start, (lower, upper) = "ratio", START, RATIO
            key = [*known].index(name)
        else:
            kind, key, start = "loss", name.partition(".")[2], START
            lower, upper = 2 * RATIO[0], 2 * RATIO[1]
        start = value if lower <= value <= upper else start
        parameters.append(DampingParameter(name, kind, key, start, lower, upper, (value,)))
    return parameters


def structure_damping_of(
    scene: Scene, material: Mapping[str, str], parameters: Sequence[DampingParameter]
) -> StructureDamping:
    """The damping of a scene in the form that responses take, with those dashpots and loss factors
    that are zero and free; `material` is that of each body."""
    law, table = damping_law(scene.damping, scene.measured_hz), scene.damping
    of_dashpots = {}
    for name, (c, _) in dashpot_keys(scene).items():
        entry, _, key = name.partition(".")[2].rpartition(".")
        if c or any(p.name == name for p in parameters):
            of_dashpots[f"{entry}.k{key[1:]}"] = c
    damping = StructureDamping(dashpot=of_dashpots, material=material)
    if isinstance(table, LossFactorsTable):
        free = {str(p.key): 0.0 for p in parameters if p.kind == "loss"}
        return damping._replace(loss=free | table.factors)
    if isinstance(table, Rayleigh):
        return damping._replace(alpha=law.alpha, beta=law.beta)
    if isinstance(table, Modal):
        ratio = (table.ratio,) if isinstance(table.ratio, float) else tuple(table.ratio)
        hz = () if len(ratio) == 1 else tuple(scene.measured_hz)
        return damping._replace(ratio=ratio, ratio_hz=hz)
    return damping


def with_dampings(scene: Scene, value: Mapping[str, float]) -> Scene:
    """The scene with damping values by name: "joints.NAME.cz" or "springs.NAME.cz" [N s/m, about an
    axis N m s/rad], "damping.alpha" [1/s], "damping.beta" [s], "damping.ratio", "damping.ratio.N"
    of measured mode N, or "damping.materials.NAME", a loss factor."""
    joints: dict[str, float] = {}
    springs = {spring.name: spring for spring in scene.springs or ()}
    table = scene.damping.model_dump(exclude_unset=True) if scene.damping else {}
    numbers = list(scene.measured_numbers)
    for name, x in value.items():
        kind, _, inner = name.partition(".")
        if kind == "joints":
            joints[inner] = float(x)
        elif kind == "springs":
            entry, _, key = inner.rpartition(".")
            springs[entry] = springs[entry].model_copy(update={key: float(x)})
        elif inner in ("alpha", "beta", "ratio"):
            table[inner] = float(x)
        elif inner.startswith("ratio."):
            ratios = list(table["ratio"])
            ratios[numbers.index(int(inner.partition(".")[2]))] = float(x)
            table["ratio"] = ratios
        else:
            of, _, part = inner.partition(".")
            table[of] = {**table.get(of, {}), part: float(x)}
    if any(name.startswith("damping.") for name in value):
        scene = scene.model_copy(update={"damping": type(scene.damping).model_validate(table)})
    if joints:
        scene = scene.with_joints(joints)
    return scene.model_copy(update={"springs": tuple(springs.values())}) if springs else scene


def require_damped(scene: Scene, parameters: Sequence[DampingParameter]) -> None:
    """Raise InvalidScene for a structure without any damping, whose resonances have no height."""
    has_dashpots = scene.has_dashpots or any(p.kind == "dashpot" for p in parameters)
    undamped = scene.damping is None or scene.damping.kind == "none"
    if undamped and not has_dashpots:
        raise InvalidScene(
            f'{scene.name}: damping.kind = "none" gives resonances no height; set '
            "damping.kind=modal with damping.ratio=0.01, and free damping.ratio."
        )
