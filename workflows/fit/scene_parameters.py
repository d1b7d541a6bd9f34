"""Parameters by the names that a user gives them: what `calibrate --free` may name of a chain and
its wall, and the keys of a scene that `inspect` and `design` find."""

from collections.abc import Callable
from difflib import get_close_matches
from math import isfinite
from typing import Any, NamedTuple

import numpy as np

from beadwave import coupling, dem
from beadwave.dem.kernels.laws import SHAPE_PARAMETERS
from beadwave.dem.sensitivities import require_smooth
from beadwave.workflows.fit.forward import OWN, SHARED
from beadwave.workflows.fit.marched_system import Rig
from beadwave.workflows.fit.parameter import RATIOS, Parameter
from beadwave.workflows.fit.parameter import trigger as first_touch
from beadwave.workflows.scene import (
    InvalidScene,
    ModalDampingTable,
    OneDofWall,
    Preload,
    RomWall,
    Scene,
    nearest,
)
from beadwave.workflows.scene.quantities import entries
from beadwave.workflows.scene.tables.contact import KEYS as CONTACT_KEYS
from beadwave.workflows.scene.toml import changed
from beadwave.workflows.stages.chain.chain import chain, initial_velocity
from beadwave.workflows.sweep.cases import Base


class Range(NamedTuple):
    """Range of a parameter unless --bounds give one, and a change of it that counts as large;
    factors on the start, or in its unit. Not varied systematically."""

    low: float
    high: float
    scale: float


CONTACT = Range(0.2, 5.0, 0.1)  # factor on the scene's stiffness
FACTOR = Range(0.05, 20.0, 0.1)  # of the start: preload, frequency and mass of the wall
SPEED_RANGE = Range(0.3, 3.0, 0.1)  # of the start
POWER = Range(1e-3, 1e3, 0.1)  # of the stiffness of a power law: tenfold for 0.2 of exponent
LOSS = Range(0.0, 10.0, 0.05)  # [s/m]
RATIO = Range(0.0, 0.5, 0.01)  # damping ratio
RATIO_START = 0.01  # where the scene has none

# what --bounds may say at most
SMALLEST = 1e-3  # of the start, of a parameter that is varied by factors; its inverse the largest
NAMES = (
    "contacts", "contact.N", "contact.stiffness",
    *(f"contact.{parameter}" for parameter in SHAPE_PARAMETERS),
    "preload", "dissipation", "striker", "trigger", "wall.frequency", "wall.mass", "wall.damping",
)  # fmt: skip


def usual(scene: Scene) -> str:
    """The names that are free unless --free says so."""
    wall = ",wall.frequency" if isinstance(scene.wall, OneDofWall) else ""
    striker = ",striker" if scene.striker else ""
    return f"contacts{striker},trigger{wall}"


def rig(scene: Scene, wall: dem.Wall | None, trigger: float) -> Rig:
    """The scene as a calibration takes it; raises InvalidScene for what has no derivatives."""
    if isinstance(wall, coupling.CoupledWall):
        raise InvalidScene(
            "a wall that is read elsewhere than it is pushed cannot be calibrated; set "
            'patch.weights = "hertz".'
        )
    start = chain(scene)
    try:
        require_smooth(start, wall)
    except dem.InvalidChain as error:
        raise InvalidScene(f"{scene.name} cannot be calibrated: {error}.") from None

    # (d, k) derivative of the wall's ratios by each ratio of the scene: each mode has that of the
    # measured mode whose frequency is nearest, by factors; rigid modes have none
    damping = None
    if isinstance(scene.wall, OneDofWall):
        damping = np.ones((1, 1))
    elif isinstance(scene.wall, RomWall) and isinstance(scene.damping, ModalDampingTable):
        from beadwave.workflows.thesis import HAMMER_TEST_HZ

        if np.ndim(scene.damping.ratio) == 0:
            damping = np.where(wall.omega > 0, 1.0, 0.0)[None]
        else:
            hz = np.maximum(wall.omega, 1e-3)[:, None] / 2 / np.pi
            distance = np.abs(np.log(hz / HAMMER_TEST_HZ))
            damping = np.eye(len(HAMMER_TEST_HZ))[:, distance.argmin(axis=1)]
    return Rig(start, wall, initial_velocity(scene), damping, trigger)


def parameters(
    scene: Scene, names: tuple[str, ...], trigger: float, bounds: dict[str, tuple[float, float]]
) -> tuple[Parameter, ...]:
    """The parameters that the names stand for, in their order: `trigger` [s] is the estimate of the
    first touch, `bounds` by name, "contacts" standing for all. Raises InvalidScene for what the
    scene lacks, for a name that comes twice and for bounds that cannot be."""
    free = [p for name in names for p in _named(scene, name, trigger)]
    twice = [p.name for i, p in enumerate(free) if p.name in [q.name for q in free[:i]]]
    if twice:
        raise InvalidScene(f"--free names {twice[0]} twice; drop one.")
    unknown = [key for key in bounds if key not in {key for p in free for key in _keys(p)}]
    if unknown:
        raise InvalidScene(f"--bounds {unknown[0]} is not among the free parameters; free it.")

    # the bounds that are given: around the start, within what a parameter may be at all
    latest = 1e-2  # [s] of the trigger to either side of the estimate
    for i, p in enumerate(free):
        if p.kind in RATIOS:
            smallest, largest = SMALLEST * p.start, p.start / SMALLEST
        elif p.kind == "trigger":
            smallest, largest = p.start - latest, p.start + latest
        else:
            # damping stays below the critical one
            smallest, largest = 0.0, 0.99 if p.kind == "damping" else np.inf
        for key in _keys(p):
            if key not in bounds:
                continue
            low, high = bounds[key]
            if not low < p.start < high:
                raise InvalidScene(
                    f"--bounds {key}={low:g}:{high:g} must hold the start {p.start:g}; widen them "
                    "or change the scene."
                )
            if not smallest <= low < high <= largest:
                raise InvalidScene(
                    f"--bounds {key}={low:g}:{high:g} must be within {smallest:.4g}:{largest:.4g}; "
                    "narrow them."
                )
            free[i] = free[i]._replace(low=low, high=high)
    return tuple(free)


def _keys(p: Parameter) -> tuple[str, ...]:
    """Names of a parameter for --bounds; the later one counts."""
    return ("contacts", f"contact.{p.index + 1}") if p.kind == "contact" else (p.name,)


def _named(scene: Scene, name: str, trigger: float) -> list[Parameter]:
    """The parameters of one name of --free; raises InvalidScene for what the scene lacks."""
    key, _, suffix = name.partition(".")
    wall = scene.wall

    def by_factors(kind: str, start: float, factors: Range, unit: str) -> list[Parameter]:
        low, high, scale = (factor * start for factor in factors)
        return [Parameter(name, kind, start, low, high, scale, unit)]

    if name == "contacts":
        contacts = range(scene.n_contacts)
        return [Parameter(f"contact {i + 1}", "contact", 1.0, *CONTACT, "", i) for i in contacts]
    if key == "contact" and suffix.isdigit() and 1 <= int(suffix) <= scene.n_contacts:
        i = int(suffix) - 1
        return [Parameter(f"contact {i + 1}", "contact", 1.0, *CONTACT, "", i)]
    if key == "contact" and (suffix == "stiffness" or suffix in SHAPE_PARAMETERS):
        start = getattr(scene.contact, suffix)
        if start is None or isinstance(start, tuple):
            laws = " or ".join(f'"{law}"' for law, keys in CONTACT_KEYS.items() if suffix in keys)
            raise InvalidScene(
                f"--free {name} needs contact.law = {laws} with one value for all contacts; give "
                f"{name} one value."
            )
        if suffix in SHAPE_PARAMETERS:
            return [Parameter(name, suffix, start, *SHAPE_PARAMETERS[suffix][1:])]
        return by_factors(suffix, start, POWER, "N/m^n")
    if name == "preload":
        force = scene.preload.force if scene.preload else 0.0
        # 1 N where the scene has none
        return by_factors("preload", force or 1.0, FACTOR, "N")
    if name == "dissipation":
        # 0.05 s/m where the scene has none
        start = float(np.max(scene.contact.coefficient)) or 0.05
        return [Parameter(name, "dissipation", start, *LOSS, "s/m")]
    if name == "striker" and scene.striker:
        return by_factors("striker", scene.striker.velocity, SPEED_RANGE, "m/s")
    if name == "trigger":
        return [first_touch(name, trigger)]
    if isinstance(wall, OneDofWall) and name == "wall.frequency":
        return by_factors("frequency", wall.frequency, FACTOR, "Hz")
    if isinstance(wall, OneDofWall) and name == "wall.mass":
        return by_factors("mass", wall.mass, FACTOR, "kg")
    if isinstance(wall, OneDofWall) and name == "wall.damping":
        return [Parameter(name, "damping", float(wall.damping_ratio) or RATIO_START, *RATIO)]
    if isinstance(wall, RomWall) and name == "wall.damping":
        if not isinstance(scene.damping, ModalDampingTable):
            raise InvalidScene(
                f"--free {name} needs modal damping, found damping.kind = {scene.damping.kind!r}; "
                "set damping.kind=modal."
            )
        ratios = np.atleast_1d(scene.damping.ratio)
        return [
            Parameter(
                name if len(ratios) == 1 else f"{name}.{i + 1}",
                "damping", float(ratio) or RATIO_START, *RATIO, "", i,
            )
            for i, ratio in enumerate(ratios)
        ]  # fmt: skip

    # nothing of that name: say what there is
    if key == "wall":
        kind = wall.kind if wall else "none"
        raise InvalidScene(
            f"--free {name} does not exist for wall.kind = {kind!r}; a 1dof wall has "
            "wall.frequency, wall.mass and wall.damping, a rom wall wall.damping."
        )
    if key == "contact" and suffix.lstrip("-").isdigit():
        raise InvalidScene(f"--free {name} is no contact, they are 1 to {scene.n_contacts}.")
    remedy = f"; `beadwave inspect --find {name}` finds any number of a scene" if suffix else ""
    raise InvalidScene(f"--free {name!r} is not known here, {nearest(name, NAMES)}{remedy}.")


def limits_of(
    text: str | None, value: Callable[[str, str], float]
) -> dict[str, tuple[float, float]]:
    """{"contacts": (0.5, 2.0)} of "contacts=0.5:2,wall.frequency=50:2000"; `value` makes a number
    of a key and the text of an end. Raises InvalidScene."""
    limits: dict[str, tuple[float, float]] = {}
    for item in text.split(",") if text else ():
        key, _, ends = (part.strip() for part in item.partition("="))
        texts = [end.strip() for end in ends.split(":")]
        if key in limits:
            raise InvalidScene(f"--bounds names {key} twice; drop one.")
        if len(texts) != 2 or not all(texts):
            raise InvalidScene(
                f"--bounds {item} is not key=low:high; write {key or 'KEY'}=LOW:HIGH."
            )
        low, high = (value(key, end) for end in texts)
        if not (isfinite(low) and isfinite(high) and low < high):
            turned = f"; write {key}={texts[1]}:{texts[0]}" if low > high else ""
            raise InvalidScene(
                f"--bounds {item} must be two finite numbers, the lower one first{turned}."
            )
        limits[key] = low, high
    return limits


def plain_number(key: str, text: str) -> float:
    """A number without a unit; raises InvalidScene."""
    try:
        return float(text)
    except ValueError:
        raise InvalidScene(
            f"--bounds {key}: {text!r} is no number; write {key}=LOW:HIGH."
        ) from None


def calibrated_scene(
    scene: Scene, parameters: tuple[Parameter, ...], value: np.ndarray, name: str
) -> Scene:
    """The scene with the parameters at these values (p,) in SI units, and another name. Factors of
    contacts multiply those that the scene has; a fitted speed takes the place of a drop."""
    factors = np.broadcast_to(np.array(scene.contact.stiffness_factor, float), scene.n_contacts)
    factors, scene = factors.copy(), scene.but(name=name)
    ratios = np.atleast_1d(getattr(scene.damping, "ratio", 0.0)).astype(float)
    for p, x in zip(parameters, map(float, value), strict=True):
        match p.kind:
            case "contact":
                factors[p.index] *= x
            case key if key == "stiffness" or key in SHAPE_PARAMETERS:
                scene = scene.but(contact={key: x})
            case "preload":
                scene = scene.but(preload=(scene.preload or Preload()).but(force=x))
            case "dissipation":
                scene = scene.but(contact={"dissipation": "hunt-crossley", "coefficient": x})
            case "striker":
                scene = scene.but(striker={"velocity": x, "drop": None})
            case "frequency" | "mass":
                scene = scene.but(wall={p.kind: x})
            case "gain":
                group = p.name.removeprefix("gain ")
                sensors = tuple(
                    sensor.but(gain=p.index * x) if sensor.gain == group else sensor
                    for sensor in scene.output.sensors or ()
                )
                scene = scene.but(output={"sensors": sensors or None})
            case "damping" if isinstance(scene.wall, OneDofWall):
                scene = scene.but(wall={"damping_ratio": x})
            case "damping":
                ratios[p.index] = x
                ratio = float(ratios[0]) if len(ratios) == 1 else tuple(map(float, ratios))
                scene = scene.but(damping={"ratio": ratio})
    if any(p.kind == "contact" for p in parameters):
        return scene.but(contact={"stiffness_factor": tuple(map(float, factors))})
    return scene


USUAL_BOUNDS = {SHARED: (0.7, 1.4), OWN: (0.5, 2.0)}  # factors on the scene's value
MOST_NUMBERS = 12
SPEED = "striker.velocity"  # of a chain; of several it follows chains.NAME


def shared(base: Base, find: str, bounds: str | None) -> tuple[Parameter, ...]:
    """The numbers to find, "a.b,c.d", within their bounds, "a.b=1mm:2mm"; raises InvalidScene."""
    keys = listed("--find", find)
    limits = limits_of(bounds, base.number)
    if unknown := next((key for key in limits if key not in keys), None):
        raise InvalidScene(
            f"--bounds {unknown} is not among the numbers to find; add it to --find."
        )
    if len(keys) > MOST_NUMBERS:
        raise InvalidScene(
            f"--find names {len(keys)} numbers, up to {MOST_NUMBERS} are allowed; drop some."
        )
    scene = base.with_values({})
    return tuple(_bounded(scene, key, number(scene, key), SHARED, limits.get(key)) for key in keys)


def listed(option: str, text: str) -> list[str]:
    """The keys of a list; raises InvalidScene for none and for one that comes twice."""
    keys = [key.strip() for key in text.split(",") if key.strip()]
    if not keys:
        raise InvalidScene(f"{option} names nothing; write {option} wall.frequency, for example.")
    if twice := next((key for key in keys if keys.count(key) > 1), None):
        raise InvalidScene(f"{option} names {twice} twice; drop one.")
    return keys


def number(scene: Scene, key: str) -> float:
    """The value of a key; raises InvalidScene for a key that has none or no number."""
    value: Any = scene.written
    for name in key.split("."):
        value = _entry(value, name)
    if isinstance(value, bool) or not isinstance(value, int | float):
        reason = "has no value" if value is None else f"is {value!r}"
        # of a key that there is not, the one of a number that was probably meant
        known = [entry.key for entry in entries(scene.written) if isinstance(entry.value, float)]
        close = get_close_matches(key, known, n=1) if value is None else []
        remedy = "name a key whose value is one number, as chain.young"
        if close:
            remedy = f"the nearest that has one is {close[0]!r}"
        raise InvalidScene(f"{key} {reason} in {scene.name}; {remedy}.")
    if isinstance(value, int):
        raise InvalidScene(f"{key} = {value} counts; name a key that varies smoothly.")
    return value


def _entry(table: Any, name: str) -> Any:
    """An entry of a table, or a table of a list by its name; None where there is none."""
    if isinstance(table, tuple):
        return next((item for item in table if getattr(item, "name", None) == name), None)
    return table.get(name) if isinstance(table, dict) else getattr(table, name, None)


def _bounded(
    scene: Scene, key: str, start: float, kind: str, limits: tuple[float, float] | None = None
) -> Parameter:
    """The number of a key within its bounds; raises InvalidScene where they do not hold its
    start."""
    if limits is None and start == 0.0:
        raise InvalidScene(
            f"{key} = 0 does not say how far it may go; add --bounds {key}=low:high."
        )
    low, high = limits or sorted(factor * start for factor in USUAL_BOUNDS[kind])
    if not low <= start <= high:
        raise InvalidScene(
            f"--bounds {key}={low:g}:{high:g} must hold the scene's value {start:g}; widen them or "
            "change the scene."
        )
    of_key = (entry for entry in entries(scene.written) if entry.key == key)
    unit = next((entry.quantity.kind.unit for entry in of_key), "")
    # 0.02 of the bounds' distance: a change that counts as large
    return Parameter(key, kind, start, low, high, 0.02 * (high - low), unit)


def per_record(base: Base, each: str, n_records: int) -> list[list[Parameter]]:
    """Numbers that every record has for itself, "key" or "key=v1,v2,..;key2", or "none"; by record.

    Raises InvalidScene.
    """
    scene = base.with_values({})
    numbers: list[list[Parameter]] = [[] for _ in range(n_records)]
    for item in () if each == "none" else each.split(";"):
        if not item.strip():
            continue
        key, _, texts = (text.strip() for text in item.partition("="))
        values = [base.number(key, text.strip()) for text in texts.split(",")] if texts else []
        if values and len(values) != n_records:
            raise InvalidScene(
                f"--each {key} has {len(values)} values for {n_records} records; give one for each."
            )
        for i, of_record in enumerate(numbers):
            start = values[i] if values else number(scene, key)
            of_record.append(_bounded(scene, key, start, OWN))
    return numbers


def usual_each(scene: Scene, find: str) -> str:
    """Parameters that every record has for itself unless they are fitted for all: the velocities
    of strikers."""
    speeds = [SPEED] if scene.striker else []
    if scene.chains:
        speeds = [f"chains.{row.name}.{SPEED}" for row in scene.chains if row.striker]
    sought = listed("--find", find)
    return ";".join(key for key in speeds if key not in sought) or "none"


def scene_at(base: Base, keys: tuple[str, ...], values: np.ndarray) -> Scene:
    """The scene with its keys at these values (q,), checked; raises InvalidScene."""
    return base.with_values(dict(zip(keys, map(float, values), strict=True)))


def changed_base(base: Base, values: dict[str, Any]) -> Base:
    """The scene with other values, to be varied further; raises InvalidScene."""
    base.with_values(values)
    return base._replace(
        written=base.written._replace(tables=changed(base.written.tables, values.items())), given=()
    )


def put(scene: Scene, keys: tuple[str, ...], values: np.ndarray) -> Scene:
    """`scene_at` of values (q,), unchecked and quicker, of a scene whose bounds have been checked:
    what follows from a value elsewhere, as a velocity from a drop, does not follow here."""
    tables: dict[str, Any] = {}
    for key, value in zip(keys, map(float, values), strict=True):
        first, *path = key.split(".")
        table = tables[first] if first in tables else getattr(scene.written, first)
        tables[first] = _with_entry(table, path, value)
    return scene.but(**tables)


def _with_entry(table: Any, path: list[str], value: float) -> Any:
    """The table with the value at a path of names below it."""
    if not path:
        return value
    first, *path = path
    if isinstance(table, tuple):
        return tuple(_with_entry(t, path, value) if t.name == first else t for t in table)
    entry = _with_entry(_entry(table, first), path, value)
    if isinstance(table, dict):
        return {**table, first: entry}
    return table.model_copy(update={first: entry})


def require_possible(base: Base, parameters: tuple[Parameter, ...]) -> None:
    """Raise InvalidScene where the end of a number's bounds is no value that a scene may have."""
    for p in parameters:
        for end in (p.low, p.high):
            try:
                base.with_values({p.name: end})
            except InvalidScene as reason:
                raise InvalidScene(f"bounds of {p.name}, {p.low:g}:{p.high:g}: {reason}") from None
