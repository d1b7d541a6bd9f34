"""Joint stiffnesses fitted to chosen hammer-test modes: from a scene to a tuned scene.

One reduction to some fifty shapes, then a fit in tenths of a second, then the full model with the
stiffnesses found as a judge.
"""

from collections.abc import Sequence
from time import perf_counter
from typing import Literal, NamedTuple

import numpy as np
from pydantic import BaseModel

import fem
from fem.tuning import Tuning, TuningParameter, determined, tune
from workflows.files.output_file import OutputFile
from workflows.report.tables import aligned_text
from workflows.scene import InvalidScene, Scene, nearest
from workflows.scene.bodies import Target
from workflows.stages.pipeline import Pipeline, Progress, pipeline_of
from workflows.structure import parameters as of_bodies
from workflows.thesis import HAMMER_TEST_HZ

JOINTS = ("head", "foot")
SHIFT = of_bodies.SHIFT
STARTS = {"ky": (1e6, *SHIFT[1:]), "kz": (3e7, *SHIFT[1:]), "kt": (1e8, *SHIFT[1:])}
FACTOR = (1.0, 0.85, 1.15)  # of the block's modulus and density
TANGENTIAL = ("kx", "kz")  # what "kt" stands for
DISAGREEMENT = 1e-3  # of the full model and the projection, relative
LARGEST_MISS = 0.05  # relative: three times what the thesis' own matches miss, table 5.3


def _unit(name: str) -> str:
    """Of a stiffness; of a material's value what it is a factor of."""
    if name.endswith(of_bodies.MATERIAL):
        return "of the rest's" if name.startswith("block.") else "of the scene's"
    return "N m/rad" if ".kr" in name else "N/m"


class TuningReport(BaseModel):
    """What was fitted, what came out, and how far to believe it."""

    scene: str
    match: dict[str, float]
    modes_hz: dict[str, float]
    full_order_hz: dict[str, float]
    stiffness: dict[str, float]
    deviation: dict[str, float | None]
    undetermined: dict[str, float | Literal["rigid"]]  # keys of the scene, the values they keep
    mac: dict[str, float]
    between_hz: list[float]
    evaluations: int
    seconds: float
    remarks: list[str]

    def text(self) -> str:
        """Aligned lines, then sentences."""
        head = ("mode", "wanted", "fitted", "full model", "MAC")
        modes = aligned_text(head, map(self._mode, self.modes_hz))
        values = aligned_text(("value", "fitted", "", ""), map(self._value, self.stiffness))
        cost = f"{self.evaluations} evaluations in {self.seconds:.2f} s"
        return "\n".join([modes, "", values, "", cost, *self.remarks])

    def _mode(self, i: str) -> tuple:
        wanted, full = self.match.get(i), self.full_order_hz.get(i)
        hz = (None if x is None else f"{x:.2f}" for x in (wanted, self.modes_hz[i], full))
        return i, *hz, f"{self.mac[i]:.2f}"

    def _value(self, name: str) -> tuple:
        spread = self.deviation[name]
        seen = "not determined by these modes" if spread is None else f"+- {100 * spread:.2g} %"
        return name, f"{self.stiffness[name]:.5g}", _unit(name), seen

    @property
    def failures(self) -> list[str]:
        """A sentence on each mode that is missed by more than a fit of it may be."""
        return [
            f"mode {n} of {self.match[n]:g} Hz is missed by {100 * off:+.3g} %, up to "
            f"{100 * LARGEST_MISS:g} % is a fit; free what moves this mode, or match others."
            for n, off in _misses(self.modes_hz, self.match).items()
        ]


def _misses(modes_hz, match) -> dict:
    """Relative misses of the modes that are no fit, by number."""
    missed = {n: modes_hz[n] / hz - 1 for n, hz in match.items()}
    return {n: off for n, off in missed.items() if not abs(off) <= LARGEST_MISS}


def tuned(
    scene: Scene, match: dict[int, float], free: tuple[str, ...], progress: Progress
) -> tuple[Scene, TuningReport]:
    """The scene with fitted joints, and the report; raises InvalidScene for what has no joints."""
    if scene.is_general:
        freed_ones = of_bodies.freed(scene, free)
    else:
        freed_ones = _of_the_rig(scene, free or usual(match))
    fit = _fitted(scene, freed_ones, match, progress)
    result = _targeted(at_values(fit.loose, fit.found.parameters, fit.found.value), match)
    full = pipeline_of(result, progress)
    fitted = {p.name for p in fit.found.parameters}
    undetermined = [p for p in freed_ones if p.name not in fitted]
    return result, _report(scene, match, fit, full, undetermined)


def _of_the_rig(scene: Scene, names: tuple[str, ...]) -> list[TuningParameter]:
    if scene.assembly.constraint != "wires":
        raise InvalidScene(
            f"assembly.constraint = {scene.assembly.constraint!r} has no springs to tune; "
            "set assembly.constraint=wires."
        )
    freed_ones = [_from(scene, p) for p in freed(names)]
    _require_joints(scene, freed_ones)
    return freed_ones


class Fit(NamedTuple):
    """A tuning of what its modes determine, the scene with springs to vary, the seconds."""

    found: Tuning
    loose: Scene
    seconds: float
    of_all: Tuning  # the fit of every parameter that the user freed


def _fitted(
    scene: Scene,
    parameters: Sequence[TuningParameter],
    match: dict[int, float],
    progress: Progress,
    of_all: Tuning | None = None,
) -> Fit:
    """The fit of those parameters that these modes determine; the others stay as they were in the
    scene. Raises InvalidScene where the modes determine none and are met all the same."""
    loose = loosened(scene, parameters)
    basis = pipeline_of(loose, progress)("tuning-basis")
    if scene.is_general:
        parameters = of_bodies.on_bodies(scene, parameters, list(basis.forms))
    started = perf_counter()
    found = tune(basis, parameters, match)
    of_all = of_all or found
    missed = _misses(dict(enumerate(found.modes_hz, start=1)), match)
    subset = parameters if missed else determined(basis, parameters, match, found)
    if len(subset) == len(parameters):
        return Fit(found, loose, perf_counter() - started, of_all)
    if not subset:
        names = ", ".join(p.name for p in of_all.parameters)
        raise InvalidScene(
            f"{scene.name}: no value of --free {names} is determined by mode "
            f"{', '.join(map(str, match))}, nothing is tuned; free what moves these modes, or "
            "match others."
        )
    return _fitted(scene, subset, match, progress, of_all)


def _require_joints(scene: Scene, parameters: list[TuningParameter]) -> None:
    """Raises InvalidScene for a spring of a joint that the assembly's parts do not have."""
    for p in parameters:
        for joint in {spring.split(".")[0] for spring in p.springs}:
            part = {"head": "sheets", "foot": "sheets_support"}[joint]
            if part not in scene.assembly.parts:
                raise InvalidScene(
                    f"{p.name} cannot be tuned: assembly.parts = {list(scene.assembly.parts)} has "
                    f"no {part}; add it, or free something else."
                )


def usual(match: dict[int, float]) -> tuple[str, ...]:
    """What to free for the modes wanted: one tangential stiffness cannot meet both 2 and 3."""
    joint = ("head.ky", "head.kz", "head.kry") if {2, 3} <= match.keys() else ("head.ky", "head.kt")
    return (*joint, "block.young", "block.density") if 4 in match else joint


def targets(match: str, measured_hz: tuple[float, ...] = HAMMER_TEST_HZ) -> dict[int, float]:
    """The modes named in "1,3,4", or "1=51.2,3=905" with frequencies of one's own."""
    pairs = [item.partition("=") for item in match.split(",")]
    try:
        found = {int(n): float(hz) if eq else measured_hz[int(n) - 1] for n, eq, hz in pairs}
    except (ValueError, IndexError):
        found = {}
    if len(found) < len(pairs) or not all(
        1 <= n <= len(measured_hz) and 0 < hz < np.inf for n, hz in found.items()
    ):
        raise InvalidScene(
            f"--match {match} must name modes 1 to {len(measured_hz)}, each once, as in 1,3,4 or "
            "1=51.2,3=905 (Hz)."
        )
    return found


def freed(names: tuple[str, ...]) -> list[TuningParameter]:
    """What the names stand for; raises InvalidScene for a stiffness that two of them set."""
    parameters, taken = [_parameter(name) for name in names], {}
    for name, p in zip(names, parameters, strict=True):
        for value in p.springs or (p.name,):
            if value in taken:
                raise InvalidScene(f"--free {taken[value]} and {name} set the same; drop one.")
            taken[value] = name
    return parameters


def _parameter(name: str) -> TuningParameter:
    part, _, key = name.partition(".")
    if part == "block" and key in ("young", "density"):
        return TuningParameter(name, (), *FACTOR, ("block",), key)
    directions = TANGENTIAL if key == "kt" else (key,)
    if part not in JOINTS or not set(directions) <= set(fem.DIRECTIONS):
        raise InvalidScene(f"--free {name} is not known, {nearest(name, _known())}.")
    springs = tuple(f"{part}.{direction}" for direction in directions)
    return TuningParameter(
        name, springs, *STARTS.get(key, of_bodies.TURN if key.startswith("kr") else SHIFT)
    )


def _from(scene: Scene, p: TuningParameter) -> TuningParameter:
    """The same, from the value that the scene has where that is one to start from."""
    scale = 1.0 if p.springs else getattr(scene.assembly, p.of)
    before = tuple(value / scale for _, value in _now(scene, p))
    start = before[0] if p.lower <= before[0] <= p.upper else p.start
    return p._replace(start=start, before=before)


def _now(scene: Scene, p: TuningParameter) -> list[tuple[str, float]]:
    """Keys of the scene that the parameter sets, each with its value."""
    if scene.is_general:
        return [(p.name, of_bodies.now(scene, p.name))]
    if p.springs:
        keys = [spring.split(".") for spring in p.springs]
        return [(f"{j}.{key}", getattr(scene.springs[j], key)) for j, key in keys]
    own = getattr(scene.assembly.block, p.of, None)
    return [(p.name, getattr(scene.assembly, p.of) if own is None else own)]


def _known() -> list[str]:
    of_joints = [f"{joint}.{key}" for joint in JOINTS for key in (*fem.DIRECTIONS, "kt")]
    return [*of_joints, "block.young", "block.density"]


def loosened(scene: Scene, parameters: list[TuningParameter]) -> Scene:
    """The scene with finite springs to vary, and of the block what is not to vary."""
    if scene.is_general:
        return at_values(scene, parameters, np.array([p.start for p in parameters]))
    varied = {p.of: None for p in parameters if not p.springs}
    bare = scene.but(assembly={"block": varied}) if scene.assembly.block else scene
    springs = [p for p in parameters if p.springs]
    return at_values(bare, springs, np.array([p.start for p in springs]))


def at_values(scene: Scene, parameters: list[TuningParameter], value) -> Scene:
    """The scene with the parameters at these values."""
    if scene.is_general:
        names = [p.name for p in parameters]
        return of_bodies.with_values(scene, dict(zip(names, value, strict=True)))
    joints, steel = {}, {}
    for p, x in zip(parameters, value, strict=True):
        for spring in p.springs:
            joint, key = spring.split(".")
            joints.setdefault(joint, {})[key] = float(x)
        if not p.springs:
            steel[p.of] = float(x) * getattr(scene.assembly, p.of)
    found = scene.but(joints=joints)
    if steel:
        from workflows.scene.assembly import Steel

        found = found.but(assembly={"block": (scene.assembly.block or Steel()).but(**steel)})
    return found


def _targeted(scene: Scene, match: dict[int, float]) -> Scene:
    """The scene with the frequencies that it was tuned to among its targets."""
    if scene.is_general:
        own = enumerate(scene.targets or (), start=1)
        told = [t.but(hz=match.get(n, t.hz)) for n, t in own]
    else:
        hz = {t.number: t.hz for t in scene.targets or ()} | match
        told = [Target(number=n, hz=hz[n]) for n in sorted(hz)]
    return scene.but(targets=tuple(told))


def _report(
    scene, match, fit: Fit, full: Pipeline, undetermined: list[TuningParameter]
) -> TuningReport:
    found, confirmed = fit.found, full("modes").paired_hz
    names = [p.name for p in found.parameters]
    numbers = [str(i) for i in range(1, len(found.modes_hz) + 1)]
    fitted, mac = dict(zip(numbers, map(float, found.modes_hz), strict=True)), shape_mac(full)
    keeps = {key: value for p in undetermined for key, value in _now(scene, p)}
    return TuningReport(
        scene=scene.name,
        match={str(n): hz for n, hz in match.items()},
        modes_hz=fitted,
        full_order_hz=confirmed,
        stiffness=dict(zip(names, map(float, found.value), strict=True)),
        deviation={
            name: float(s) if np.isfinite(s) else None
            for name, s in zip(names, found.deviation, strict=True)
        },
        undetermined={key: "rigid" if np.isinf(x) else x for key, x in keeps.items()},
        mac=mac,
        between_hz=[float(hz) for hz in found.all_hz if not np.any(np.isclose(hz, found.modes_hz))],
        evaluations=found.evaluations,
        seconds=fit.seconds,
        remarks=[
            *_undetermined(match, keeps, names),
            *_contradicted(match, fit, names),
            *_remarks(scene, match, fitted, confirmed, found, undetermined),
            *_drifted(mac),
        ],
    )


def _undetermined(match, keeps: dict[str, float], names: list[str]) -> list[str]:
    if not keeps:
        return []
    modes = "mode " + ", ".join(map(str, match))
    return [
        *(
            f"{key} is not determined by {modes}: it stays {'rigid' if np.isinf(x) else f'{x:g}'}."
            for key, x in keeps.items()
        ),
        f"The fit was repeated with what these modes determine: --free {','.join(names)}.",
    ]


def _contradicted(match, fit: Fit, names: list[str]) -> list[str]:
    """Modes that are missed with the values kept, and were met while these were free: of a joint
    much stiffer than its scene has it, the modes tell a least stiffness and no more."""
    missed = [
        f"mode {n}"
        for n, hz in match.items()
        if abs(fit.found.modes_hz[n - 1] / hz - 1) > DISAGREEMENT
        and abs(fit.of_all.modes_hz[n - 1] / hz - 1) < DISAGREEMENT / 2
    ]
    values = [
        f"{p.name} = {x:.3g} ({_unit(p.name)})"
        for p, x in zip(fit.of_all.parameters, fit.of_all.value, strict=True)
        if p.name not in names
    ]
    if not missed:
        return []
    return [
        f"{', '.join(missed)} would be met with {', '.join(values)}, which the modes do not "
        "determine: set a value like this in the scene, inf for rigid, and tune again."
    ]


def _remarks(
    scene, match, fitted, confirmed, found: Tuning, undetermined: list[TuningParameter]
) -> list[str]:
    remarks = []
    missed = {n: fitted[str(n)] / hz - 1 for n, hz in match.items()}
    for n, error in missed.items():
        if abs(error) > DISAGREEMENT:
            remarks.append(f"mode {n} is missed by {100 * error:+.1f} %.")
    names = {p.name for p in (*found.parameters, *undetermined)}
    stiff = not scene.is_general and not {"head.kz", "head.kry"} <= names
    if stiff and {2, 3} <= match.keys() and max(map(abs, missed.values())) > DISAGREEMENT:
        remarks.append(
            "Modes 2 and 3 both shear the joints along x: one stiffness for x and z that is soft "
            "enough for mode 2 pulls mode 3 down with it. Free head.kz and head.kry instead."
        )
    for i, hz in confirmed.items():
        if abs(fitted[i] / hz - 1) > DISAGREEMENT:
            remarks.append(
                f"the full model has mode {i} at {hz:.2f} Hz: the projection is inaccurate."
            )
    return remarks


def shape_mac(full: Pipeline) -> dict[str, float]:
    """MAC of the modes found with those of stiff joints, as `beadwave modes` has it."""
    index, mac = full("modes").index, full("mac")
    return {str(j + 1): float(mac[i, j]) if i >= 0 else np.nan for j, i in enumerate(index)}


def _drifted(mac: dict[str, float]) -> list[str]:
    return [
        f"the shape of mode {i} has a MAC of {share:.2f} with that of stiff joints: a frequency "
        "that matches is no proof of the joint."
        for i, share in mac.items()
        if share < 0.8
    ]


def write_scene(scene: Scene, file: OutputFile, report: TuningReport) -> None:
    """Write the tuned scene as TOML with a first line on where its joints come from."""
    from workflows.scene.toml import toml

    wanted = ", ".join(f"{n}: {hz:g} Hz" for n, hz in report.match.items())
    text = f"# Joints inferred from modes {wanted}; deviations assume 0.1 % in frequency.\n"
    with file.writing() as part:
        part.write_text(text + toml(scene), encoding="utf-8")
