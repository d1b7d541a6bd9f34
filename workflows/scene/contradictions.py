"""Keys of a scene that are each allowed but not together, a sentence each."""

from math import isinf
from pathlib import Path

from workflows.scene import DashpotWall, ModalDamping, RayleighDamping, RomWall, Scene
from workflows.scene.body_contradictions import of_bending, of_bodies, of_the_rig
from workflows.scene.gravity import of_gravity
from workflows.scene.named_files import unfit
from workflows.scene.size import too_large

LEAST_YIELD = 1e-6  # pressure over Young's modulus; lead has a thousandth
SOFTEST = 1e6  # [Pa] Young's modulus of a body of finite elements
MOST_DAMPED = 1e6  # [s/m] of Hunt and Crossley's law, whose spheres rebound below one
MOST_TAKEN = 1e6  # samples of an instrument
PER_CONTACT = ("coefficient", "stiffness_factor", "yield_pressure")


def contradictions(scene: Scene):
    """What speaks against the scene, its defaults filled in; nothing for a good one."""
    yield from _missing_parts(scene)
    yield from of_bending(scene)
    if scene.is_general:
        yield from of_bodies(scene)
        yield from _other_surface(scene)
        yield from _dashpots(scene)
    else:
        yield from of_the_rig(scene)
        if scene.assembly is not None:
            yield from _other_surface(scene)
            yield from _too_soft(scene)
            yield from _outside_patch(scene)
            yield from _unread_nodes(scene)
            yield from _rigid_dashpots(scene)
            yield from _dashpots(scene)
    yield from _too_few_modes(scene)
    yield from _driven_modes(scene)
    yield from too_large(scene)
    if scene.chain:
        yield from _wrong_lengths(scene)
        yield from _one_step(scene)
        yield from _against_a_dashpot(scene)
        yield from of_gravity(scene)
        yield from _yielding(scene)
        yield from _overdamped(scene)
        yield from _at_rest(scene)
        yield from _unseen_spheres(scene)
        yield from _sensors(scene)


def _missing_parts(scene: Scene):
    chain, wall = scene.chain, scene.wall
    for name in ("gravity", "guides"):
        if chain is None and getattr(scene, name):
            yield f"[{name}] needs a [chain] that it acts on; add one or drop [{name}]."
    if chain is None and not scene.has_structure:
        yield "there is none of [chain], [assembly], [beam] and [plate]; add one of them."
    if chain is None and wall is not None:
        yield "[wall] needs a [chain] that hits it; add one or drop [wall]."
    if isinstance(wall, RomWall) and wall.file is None and not scene.has_structure:
        yield 'wall.kind = "rom" needs [assembly], [beam], [plate] or wall.file; add one of them.'
    if isinstance(wall, RomWall) and wall.file and (why := unfit(Path(wall.file))):
        yield f"wall.file = {wall.file!r} {why}; give a .npz, .mat, .h5 or .mtx."
    if chain and wall is None and chain.count < 2:
        yield "chain.count = 1 must be at least 2 without a wall; add spheres or [wall]."
    if chain and wall is None and scene.preload and scene.preload.force > 0:
        yield f"preload.force = {scene.preload.force} needs a wall to push against; add [wall]."


def _one_step(scene: Scene):
    time = scene.time
    if time and time.dt is not None and time.dt > time.duration:
        yield (
            f"time.dt = {time.dt:g} is longer than time.duration = {time.duration:g}; "
            "give a smaller step, or time.error."
        )


def _other_surface(scene: Scene):
    if not isinstance(scene.wall, RomWall) or scene.wall.file:
        return
    struck = scene.struck_material
    for key, unit in (("young", " Pa"), ("poisson", "")):
        given, own = getattr(scene.wall, key), getattr(struck, key)
        if given is not None and given != own:
            told = list(own) if isinstance(own, tuple) else f"{own:g}"
            yield (
                f"wall.{key} = {given:g}{unit}, but the wall is the assembly's "
                f"{scene.struck_body}, whose {key} is {told}{unit}; drop wall.{key}, or change "
                "what the body is made of."
            )


def _rigid_dashpots(scene: Scene):
    for joint, table, key in _damped(scene):
        name = f"joints.{joint}.c{key[1:]} = {table.dashpots[key]}"
        if scene.assembly.constraint != "wires":
            yield f'{name} needs the joints of assembly.constraint = "wires"; change one of them.'
        if isinf(getattr(table, key)):
            yield f"{name} is beside {key} = inf, which never moves; give joints.{joint}.{key}."


def _damped(scene: Scene) -> list[tuple]:
    return [(joint, table, key) for joint, table in scene.springs.items() for key in table.dashpots]


def _dashpots(scene: Scene):
    damped = _damped(scene)
    if damped and scene.reduction.kind != "craig-bampton":
        yield (
            'dashpots in joints need reduction.kind = "craig-bampton", whose boundary holds them; '
            "change it."
        )
    if damped and scene.time and scene.time.dt is not None:
        yield (
            "dashpots in joints couple the modes and are marched to an error; give time.error, "
            "not time.dt."
        )
    if damped and getattr(scene.wall, "prune", False):
        yield "dashpots in joints couple the modes, none can be left out alone; drop wall.prune."


def _too_few_modes(scene: Scene):
    table, kept = scene.reduction, len(scene.measured_hz)
    if scene.assembly is None or table.choice != "contact" or table.modes is None:
        return
    if table.modes < kept:
        yield (
            f"reduction.modes = {table.modes} must be at least {kept}, the measured "
            'modes that reduction.choice = "contact" keeps; raise it, or choose "lowest".'
        )


def _driven_modes(scene: Scene):
    if not isinstance(scene.damping, RayleighDamping) or not scene.damping.frequency:
        return
    import coupling

    (f1, f2), (zeta1, zeta2) = scene.damping.frequency, scene.damping.ratio
    try:
        coupling.rayleigh(f1, zeta1, f2, zeta2)
    except coupling.CouplingError as error:
        yield f"damping: {error}"


def _too_soft(scene: Scene):
    bodies = {f"assembly.{name}": getattr(table, "young", None) for name, table in scene.assembly}
    for name, young in {"assembly": scene.assembly.young, **bodies}.items():
        if young is not None and young < SOFTEST:
            yield (
                f"{name}.young = {young:g} Pa must be at least {SOFTEST:g} Pa, that of rubber: "
                "softer bodies have too many modes; raise it."
            )


def _outside_patch(scene: Scene):
    sides = (scene.assembly.block_y, scene.assembly.block_z)
    if 2 * scene.patch.radius >= min(sides):
        yield (
            f"patch.radius = {scene.patch.radius} m must be below {min(sides) / 2:.6g} m to lie "
            "on the block's face; lower it."
        )
        return
    for axis, at, side in zip("yz", scene.patch.point, sides, strict=True):
        reach = side / 2 - scene.patch.radius
        if abs(at) > reach:
            yield (
                f"patch.point has {axis} = {at} m, allowed is up to {reach:.6g} m from the "
                f"middle of the block's face for patch.radius = {scene.patch.radius} m; move it."
            )


def _unread_nodes(scene: Scene):
    half = (scene.assembly.block_y / 2, scene.assembly.block_z / 2)
    for point in scene.patch.nodes or ():
        if any(abs(at) > reach for at, reach in zip(point, half, strict=True)):
            yield (
                f"patch.nodes has {list(point)}, allowed are y, z up to {half[0]:.6g} and "
                f"{half[1]:.6g} m from the middle of the block's face; move it."
            )
    if scene.patch.weights != "thesis":
        return
    if scene.reduction.kind != "craig-bampton":
        yield (
            'patch.weights = "thesis" reads nodes that only reduction.kind = "craig-bampton" '
            "keeps; change one of them."
        )
    if scene.time and scene.time.dt is not None:
        yield 'patch.weights = "thesis" is marched to an error; give time.error, not time.dt.'
    if getattr(scene.wall, "prune", False):
        yield 'patch.weights = "thesis" makes no modes to leave out; drop wall.prune.'


def _wrong_lengths(scene: Scene):
    n, contacts = scene.chain.count, scene.n_contacts
    each = [
        (f"chain.{key}", getattr(scene.chain, key), n) for key in type(scene.chain).model_fields
    ]
    each += [(f"contact.{key}", getattr(scene.contact, key), contacts) for key in PER_CONTACT]
    if scene.guides:
        each += [("guides.force", scene.guides.force, n)]
    if scene.leaf_springs:
        each += [(f"leaf_springs.{key}", value, n) for key, value in scene.leaf_springs]
    if isinstance(scene.damping, ModalDamping):
        each += [("damping.ratio", scene.damping.ratio, len(scene.measured_hz))]
    for key, value, length in each:
        if isinstance(value, tuple) and len(value) != length:
            yield f"{key} has {len(value)} values, {length} are allowed; give one each."


def _against_a_dashpot(scene: Scene):
    if not isinstance(scene.wall, DashpotWall):
        return
    if scene.preload and scene.preload.force > 0:
        yield (
            f'preload.force = {scene.preload.force} N with wall.kind = "dashpot", which gives way '
            "to any steady force; set it to 0, or take another wall."
        )
    given = scene.contact.coefficient
    last = given[-1] if isinstance(given, tuple) else given
    if last > 0 and scene.contact.dissipation != "none":
        yield (
            f'contact.coefficient is {last} at the wall, with wall.kind = "dashpot" it must be 0 '
            "there; give a value for each contact, or drop it."
        )


def _overdamped(scene: Scene):
    given = scene.contact.coefficient
    largest = max(given) if isinstance(given, tuple) else given
    if scene.contact.dissipation == "hunt-crossley" and largest > MOST_DAMPED:
        yield (
            f"contact.coefficient = {largest:g} s/m, allowed with dissipation = "
            f'"hunt-crossley" is up to {MOST_DAMPED:g} s/m; from some 1000 s/m on nothing '
            "rebounds, lower it."
        )


def _yielding(scene: Scene):
    if scene.contact.law != "thornton":
        return
    others = {
        'wall.kind = "dashpot"': isinstance(scene.wall, DashpotWall),
        'patch.weights = "thesis"': scene.patch is not None and scene.patch.weights == "thesis",
        "dashpots in joints": any(table.dashpots for table in scene.springs.values()),
    }
    lowest, least = _lowest(scene.contact.yield_pressure), LEAST_YIELD * _lowest(scene.chain.young)
    if lowest < least:
        yield (
            f"contact.yield_pressure = {lowest:g} Pa must be at least {least:g} Pa, a millionth of "
            "chain.young; raise it."
        )
    for other in (name for name, given in others.items() if given):
        yield f'contact.law = "thornton" is not marched with {other}; change one of them.'


def _lowest(value) -> float:
    return min(value) if isinstance(value, tuple) else value


def _at_rest(scene: Scene):
    given = scene.chain.initial_velocity is not None
    if given and scene.striker:
        yield "chain.initial_velocity replaces [striker]; drop one of them."
    if scene.striker is None and not any(scene.chain.initial_velocity or ()):
        yield "nothing moves; add [striker] velocity or chain.initial_velocity."


def _unseen_spheres(scene: Scene):
    seen, count = scene.output.spheres, scene.chain.count
    if seen and max(seen) > count:
        others = sorted({min(sphere, count) for sphere in seen})
        yield (
            f"output.spheres has {max(seen)}, allowed are 1 to chain.count = {count}; set it too, "
            f'--set output.spheres="{others}", or add spheres.'
        )


def _sensors(scene: Scene):
    sensors, instrument = scene.output.sensors or (), scene.output.instrument
    if instrument and not sensors:
        yield "output.instrument records nothing; add output.sensors, or drop it."
    for i, one in enumerate(sensors, start=1):
        key = f"output.sensors.{i}"
        if one.sphere > scene.chain.count:
            yield (
                f"{key}.sphere = {one.sphere}, allowed are 1 to chain.count = {scene.chain.count}; "
                "change it or add spheres."
            )
        if one.label in [other.label for other in sensors[: i - 1]]:
            yield f"{key} is a second sensor of {one.label}; drop it."
        if isinstance(one.gain, str) and one.quantity != _first_of(sensors, one.gain):
            yield f"{key}.gain = {one.gain!r} is another quantity's; give it a name of its own."
        if one.gain == 0:
            yield f"{key}.gain = 0 shows nothing; give another, or a name if it is not known."
        if one.low_pass and one.high_pass and one.high_pass >= one.low_pass:
            yield (
                f"{key}.high_pass = {one.high_pass:g} Hz must be below its low_pass = "
                f"{one.low_pass:g} Hz; lower it."
            )
    taken = instrument.sampling * scene.time.duration if instrument and scene.time else 0.0
    if not (2 <= taken <= MOST_TAKEN or not instrument):
        yield (
            f"output.instrument.sampling = {instrument.sampling:g} Hz takes {taken:.3g} samples in "
            f"time.duration, allowed are 2 to {MOST_TAKEN:.0e}; change one of them."
        )


def _first_of(sensors, gain: str) -> str:
    """The quantity of the first sensor with a gain of this name."""
    return next(one.quantity for one in sensors if one.gain == gain)
