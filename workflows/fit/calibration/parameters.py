"""What `beadwave calibrate --free` may name, where it starts and how far it may go."""

from math import isfinite

import numpy as np

import coupling
import dem
from workflows.fit.core.calibration.parameters import RATIOS, Parameter, Rig
from workflows.scene import (
    InvalidScene,
    ModalDampingTable,
    OneDofWall,
    Preload,
    RomWall,
    Scene,
    nearest,
)
from workflows.stages.chain import chain, initial_velocity

CONTACT = (0.2, 5.0, 0.1)  # factor on the scene's stiffness: low, high, scale
FACTOR = (0.05, 20.0, 0.1)  # of the start: low, high, scale
SPEED = (0.3, 3.0, 0.1)  # of the start
LOSS = (0.05, 0.0, 10.0, 0.05)  # start where the scene has none, low, high, scale [s/m]
PRELOAD = 1.0  # start where the scene has none [N]
RATIO = (0.01, 0.0, 0.5, 0.01)  # start where the scene has none, low, high, scale
TRIGGER = (1e-4, 3e-6)  # to either side of the estimate, scale [s]
SMALLEST = 1e-3  # of the start, of a parameter that is varied by factors
LATEST = 1e-2  # trigger to either side of the estimate [s]
CRITICAL = 0.99  # ratio
NAMES = (
    "contacts", "contact.N", "preload", "dissipation", "striker", "trigger", "wall.frequency",
    "wall.mass", "wall.damping",
)  # fmt: skip


def usual(scene: Scene) -> str:
    """What is freed unless the user says."""
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
        dem.sensitivities.require_smooth(start, wall)
    except dem.InvalidChain as error:
        raise InvalidScene(f"{scene.name} cannot be calibrated: {error}.") from None
    return Rig(start, wall, initial_velocity(scene), _damping(scene, wall), trigger)


def _damping(scene: Scene, wall: dem.Wall | None) -> np.ndarray | None:
    """(d, k) derivative of the wall's ratios by each ratio of the scene."""
    if isinstance(scene.wall, OneDofWall):
        return np.ones((1, 1))
    if not isinstance(scene.wall, RomWall) or not isinstance(scene.damping, ModalDampingTable):
        return None
    from workflows.thesis import HAMMER_TEST_HZ

    if np.ndim(scene.damping.ratio) == 0:
        return np.where(wall.omega > 0, 1.0, 0.0)[None]
    near = np.abs(np.log(np.maximum(wall.omega, 1e-3)[:, None] / 2 / np.pi / HAMMER_TEST_HZ))
    return np.eye(len(HAMMER_TEST_HZ))[:, near.argmin(axis=1)]


def parameters(
    scene: Scene, names: tuple[str, ...], trigger: float, bounds: dict[str, tuple[float, float]]
) -> tuple[Parameter, ...]:
    """The parameters that the names stand for; raises InvalidScene for what the scene lacks."""
    found: list[Parameter] = []
    for name in names:
        found += _named(scene, name, trigger)
    twice = [p.name for i, p in enumerate(found) if p.name in [q.name for q in found[:i]]]
    if twice:
        raise InvalidScene(f"--free names {twice[0]} twice; drop one.")
    unknown = [key for key in bounds if key not in {key for p in found for key in _keys(p)}]
    if unknown:
        raise InvalidScene(f"--bounds {unknown[0]} is not among the free parameters; free it.")
    return tuple(_bounded(p, bounds) for p in found)


def _keys(p: Parameter) -> tuple[str, ...]:
    return ("contacts", f"contact.{p.index + 1}") if p.kind == "contact" else (p.name,)


def _bounded(p: Parameter, bounds: dict) -> Parameter:
    for key in _keys(p):
        if key in bounds:
            low, high = bounds[key]
            least, most = _possible(p)
            if not low < p.start < high:
                raise InvalidScene(
                    f"--bounds {key}={low:g}:{high:g} must hold the start {p.start:g}; widen them "
                    "or change the scene."
                )
            if not least <= low < high <= most:
                raise InvalidScene(
                    f"--bounds {key}={low:g}:{high:g} must be within {least:.4g}:{most:.4g}; "
                    "narrow them."
                )
            p = p._replace(low=low, high=high)
    return p


def _possible(p: Parameter) -> tuple[float, float]:
    """What a parameter may be at all: factors stay above 0, a damping below critical."""
    if p.kind in RATIOS:
        return SMALLEST * p.start, p.start / SMALLEST
    if p.kind == "trigger":
        return p.start - LATEST, p.start + LATEST
    return 0.0, CRITICAL if p.kind == "damping" else np.inf


def _named(scene: Scene, name: str, trigger: float) -> list[Parameter]:
    key, _, part = name.partition(".")
    if name == "contacts":
        return [_contact(i) for i in range(scene.n_contacts)]
    if key == "contact" and part.isdigit() and 1 <= int(part) <= scene.n_contacts:
        return [_contact(int(part) - 1)]
    if name == "preload":
        start = (scene.preload.force if scene.preload else 0.0) or PRELOAD
        return [_scaled("preload", "preload", start, FACTOR, "N")]
    if name == "dissipation":
        usual = np.max(scene.contact.coefficient)
        start, low, high, scale = LOSS
        return [_plain(name, "dissipation", float(usual) or start, low, high, scale, "s/m")]
    if name == "striker" and scene.striker:
        return [_scaled("striker", "striker", scene.striker.velocity, SPEED, "m/s")]
    if name == "trigger":
        reach, scale = TRIGGER
        return [_plain(name, name, trigger, trigger - reach, trigger + reach, scale, "s")]
    if key == "wall":
        return _of_wall(scene, name)
    if key == "contact" and part.lstrip("-").isdigit():
        raise InvalidScene(f"--free {name} is no contact, they are 1 to {scene.n_contacts}.")
    other = f"; `beadwave inspect --find {name}` finds any number of a scene" if part else ""
    raise InvalidScene(f"--free {name!r} is not known here, {nearest(name, NAMES)}{other}.")


def _contact(i: int) -> Parameter:
    low, high, scale = CONTACT
    return Parameter(f"contact {i + 1}", "contact", 1.0, low, high, scale, "", i)


def _scaled(name, kind, start, factors, unit) -> Parameter:
    low, high, scale = (factor * start for factor in factors)
    return Parameter(name, kind, start, low, high, scale, unit)


def _plain(name, kind, start, low, high, scale, unit, index=0) -> Parameter:
    return Parameter(name, kind, start, low, high, scale, unit, index)


def _of_wall(scene: Scene, name: str) -> list[Parameter]:
    wall = scene.wall
    if isinstance(wall, OneDofWall):
        if name == "wall.frequency":
            return [_scaled(name, "frequency", wall.frequency, FACTOR, "Hz")]
        if name == "wall.mass":
            return [_scaled(name, "mass", wall.mass, FACTOR, "kg")]
        if name == "wall.damping":
            return [_ratio(name, wall.damping_ratio, 0)]
    if isinstance(wall, RomWall) and name == "wall.damping":
        if not isinstance(scene.damping, ModalDampingTable):
            raise InvalidScene(
                f"--free {name} needs modal damping, found damping.kind = {scene.damping.kind!r}; "
                "set damping.kind=modal."
            )
        ratios = np.atleast_1d(scene.damping.ratio)
        if len(ratios) == 1:
            return [_ratio(name, ratios[0], 0)]
        return [_ratio(f"{name}.{i + 1}", ratio, i) for i, ratio in enumerate(ratios)]
    kind = wall.kind if wall else "none"
    raise InvalidScene(
        f"--free {name} does not exist for wall.kind = {kind!r}; a 1dof wall has wall.frequency, "
        "wall.mass and wall.damping, a rom wall wall.damping."
    )


def _ratio(name: str, ratio: float, index: int) -> Parameter:
    start, low, high, scale = RATIO
    return _plain(name, "damping", float(ratio) or start, low, high, scale, "", index)


def bounds(text: str | None) -> dict[str, tuple[float, float]]:
    """{"contacts": (0.5, 2.0)} of "contacts=0.5:2,wall.frequency=50:2000"."""
    found = {}
    for item in text.split(",") if text else ():
        key, _, limits = item.partition("=")
        low, _, high = limits.partition(":")
        if key.strip() in found:
            raise InvalidScene(f"--bounds names {key.strip()} twice; drop one.")
        try:
            found[key.strip()] = (float(low), float(high))
        except ValueError:
            raise InvalidScene(
                f"--bounds {item} is not key=low:high; write contacts=0.5:2."
            ) from None
        if not (isfinite(float(low)) and isfinite(float(high)) and float(low) < float(high)):
            raise InvalidScene(f"--bounds {item} must be finite and grow; write contacts=0.5:2.")
    return found


def calibrated_scene(
    scene: Scene, found: tuple[Parameter, ...], value: np.ndarray, name: str
) -> Scene:
    """The scene with the parameters at these values."""
    factors = np.broadcast_to(np.array(scene.contact.stiffness_factor, float), scene.n_contacts)
    factors, scene = factors.copy(), scene.but(name=name)
    ratios = np.atleast_1d(getattr(scene.damping, "ratio", 0.0)).astype(float)
    for p, x in zip(found, map(float, value), strict=True):
        match p.kind:
            case "contact":
                factors[p.index] *= x
            case "preload":
                scene = scene.but(preload=(scene.preload or Preload()).but(force=x))
            case "dissipation":
                scene = scene.but(contact={"dissipation": "hunt-crossley", "coefficient": x})
            case "striker":
                scene = scene.but(striker={"velocity": x, "drop": None})
            case "frequency" | "mass":
                scene = scene.but(wall={p.kind: x})
            case "gain":
                scene = _with_gain(scene, p.name.removeprefix("gain "), p.index * x)
            case "damping" if isinstance(scene.wall, OneDofWall):
                scene = scene.but(wall={"damping_ratio": x})
            case "damping":
                ratios[p.index] = x
                ratio = float(ratios[0]) if len(ratios) == 1 else tuple(map(float, ratios))
                scene = scene.but(damping={"ratio": ratio})
    if any(p.kind == "contact" for p in found):
        return scene.but(contact={"stiffness_factor": tuple(map(float, factors))})
    return scene


def _with_gain(scene: Scene, name: str, gain: float) -> Scene:
    """The scene with the gain of its sensors of this name."""
    own = scene.output.sensors or ()
    sensors = tuple(one.but(gain=gain) if one.gain == name else one for one in own)
    return scene.but(output={"sensors": sensors or None})
