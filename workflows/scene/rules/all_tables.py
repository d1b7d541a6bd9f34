"""Keys of a scene that are each allowed but not together, a sentence each."""

from collections.abc import Iterator
from pathlib import Path

from beadwave.workflows.scene import (
    LossFactorsTable,
    MeasuredWall,
    ModalDampingTable,
    RayleighDampingTable,
    RomWall,
    Scene,
)
from beadwave.workflows.scene.named_files import unfit
from beadwave.workflows.scene.rig import RigScene, RigTable
from beadwave.workflows.scene.rules.bodies import (
    of_bending,
    of_bodies,
    of_masses,
    of_measured,
    of_springs,
    of_test_axes,
    without_assembly,
)
from beadwave.workflows.scene.rules.chains import of_chains
from beadwave.workflows.scene.rules.contact import of_yield
from beadwave.workflows.scene.rules.crystal import of_crystal
from beadwave.workflows.scene.rules.friction import of_friction, of_gravity
from beadwave.workflows.scene.rules.rig import of_the_rig
from beadwave.workflows.scene.rules.sensors import of_sensors
from beadwave.workflows.scene.rules.shakers import of_shakers
from beadwave.workflows.scene.rules.size import too_large
from beadwave.workflows.scene.tables.walls import gives_way

# Bounds on combinations of keys, by orders of magnitude beyond real cases
MAX_HUNT_CROSSLEY = 1e6  # [s/m] of Hunt and Crossley's law, at most; from 1e3 nothing rebounds


def contradictions(scene: Scene) -> Iterator[str]:
    """Sentences on what contradicts itself in a scene as it is written, with all defaults; none for
    a sound one.

    Only the first one is shown, so that a missing part comes before what follows from it.
    """
    if scene.gravity and scene.gravity.direction and not scene.chains:
        yield "gravity.direction is of [[chains]]; give gravity.inclination, or drop it."
    if scene.mesh is not None and not scene.has_structure:
        yield "[mesh] is of an [assembly], which this scene has not; add one or drop [mesh]."
    if scene.crystal:
        yield from of_crystal(scene)
        yield from _of_time(scene)
        if scene.crystal.on is None:
            return  # the other rules are of chains and structures
    if scene.chains:
        yield from of_chains(scene)
        yield from _of_time(scene)
    if not scene.crystal:
        yield from _missing_parts(scene)
    yield from of_bending(scene)
    if isinstance(scene.assembly, RigTable):
        yield from of_the_rig(scene)
        scene = RigScene.of(scene)
    if scene.assembly is None:
        yield from without_assembly(scene)
    else:
        yield from of_bodies(scene)
        yield from _other_surface(scene)
        yield from _of_reading(scene)
        yield from _dashpots(scene)
    yield from of_masses(scene)
    yield from of_springs(scene)
    yield from of_measured(scene)
    yield from of_test_axes(scene)
    yield from _of_modes(scene)
    yield from too_large(scene)
    if scene.chain:
        yield from _of_chain(scene)
    if scene.chain or scene.chains:
        yield from of_sensors(scene)


def _missing_parts(scene: Scene) -> Iterator[str]:
    """Tables that act on a part which the scene does not have, and files that are not there."""
    chain, wall = scene.chain, scene.wall
    for name in ("gravity", "guides", "friction", "arm", "shakers"):
        of_chains = scene.chains and name in ("gravity", "friction", "arm", "shakers")
        if chain is None and getattr(scene, name) and not of_chains:
            yield f"[{name}] needs a [chain] that it acts on; add one or drop [{name}]."
    if chain is None and not scene.has_structure:
        yield "[chain], [crystal], [assembly], [beam] and [plate] are all missing; add one of them."
    if chain is None and wall is not None:
        yield "[wall] needs a [chain] that hits it; add one or drop [wall]."
    if isinstance(wall, RomWall) and wall.file is None and not scene.has_structure:
        yield 'wall.kind = "rom" needs [assembly], [beam], [plate] or wall.file; add one of them.'
    if isinstance(wall, MeasuredWall) and (why := unfit(Path(wall.receptance))):
        yield f"wall.receptance = {wall.receptance!r} {why}; give a .uff, .unv, .csv or .mat."
    if isinstance(wall, RomWall) and wall.file and (why := unfit(Path(wall.file))):
        yield f"wall.file = {wall.file!r} {why}; give a .npz, .mat, .h5 or .mtx."
    if chain and wall is None and chain.count < 2:
        yield "chain.count = 1 must be at least 2 without a wall; add spheres or [wall]."
    if chain and wall is None and scene.preload and scene.preload.force > 0:
        yield f"preload.force = {scene.preload.force} needs a wall to push against; add [wall]."


def _other_surface(scene: Scene) -> Iterator[str]:
    """A wall made of the assembly has the material of the body struck; a stated one must agree."""
    if not isinstance(scene.wall, RomWall) or scene.wall.file:
        return
    for key, unit in (("young", " Pa"), ("poisson", "")):
        of_wall, value = getattr(scene.wall, key), getattr(scene.struck_material, key)
        if of_wall is not None and of_wall != value:
            text = list(value) if isinstance(value, tuple) else f"{value:g}"
            yield (
                f"wall.{key} = {of_wall:g}{unit}, but the wall is the assembly's "
                f"{scene.struck_body}, whose {key} is {text}{unit}; drop wall.{key}, or change "
                "what the body is made of."
            )


def _of_reading(scene: Scene) -> Iterator[str]:
    """The thesis' scheme pushes and reads at different nodes."""
    strike = scene.strike
    if strike is None or strike.weights != "thesis":
        return
    key = f'{scene.strike_table}.weights = "thesis"'
    if len(strike.at) != 2:
        yield f"{key} needs a plane face and strike.at = [y, z] from its middle."
    if scene.reduction.kind != "craig-bampton":
        yield (
            f'{key} reads nodes that only reduction.kind = "craig-bampton" keeps; change one of '
            "them."
        )
    if scene.time and scene.time.dt is not None:
        yield f"{key} is marched to an error; give time.error, not time.dt."


def _dashpots(scene: Scene) -> Iterator[str]:
    """Dashpots couple the modes of the wall."""
    if not scene.has_dashpots:
        return
    in_joints = any(table.dashpots for table in scene.bushings.values())
    if in_joints and scene.reduction.kind != "craig-bampton":
        yield (
            'dashpots in joints need reduction.kind = "craig-bampton", whose boundary holds them; '
            "change it."
        )
    if scene.time and scene.time.dt is not None:
        yield (
            "dashpots in joints and parallel to springs couple the modes and are marched to an "
            "error; give time.error, not time.dt."
        )


def _of_modes(scene: Scene) -> Iterator[str]:
    """Contradictions of the number of modes and of their damping."""
    table, n_measured = scene.reduction, len(scene.measured_hz)
    counted = scene.assembly is not None and table.choice == "contact" and table.modes is not None
    if counted and table.modes < n_measured:
        yield (
            f"reduction.modes = {table.modes} must be at least {n_measured}, the measured "
            'modes that reduction.choice = "contact" keeps; raise it, or choose "lowest".'
        )
    if isinstance(scene.damping, LossFactorsTable):
        if scene.assembly is None or getattr(scene.wall, "file", None):
            yield (
                'damping.kind = "loss" shares out the strain of bodies, of which this scene has '
                'none; take damping.kind = "modal".'
            )
    if isinstance(scene.damping, RayleighDampingTable) and scene.damping.frequency:
        from beadwave import coupling

        (f1, f2), (zeta1, zeta2) = scene.damping.frequency, scene.damping.ratio
        try:
            coupling.rayleigh(f1, zeta1, f2, zeta2)
        except coupling.CouplingError as error:
            yield f"damping: {error}"


def _of_time(scene: Scene) -> Iterator[str]:
    """A step that is longer than the run."""
    time = scene.time
    if time and time.dt is not None and time.dt > time.duration:
        yield (
            f"time.dt = {time.dt:g} is longer than time.duration = {time.duration:g}; "
            "give a smaller step, or time.error."
        )


def _of_chain(scene: Scene) -> Iterator[str]:
    """Spheres, contacts and what drives them."""
    chain, contact = scene.chain, scene.contact

    # lists have a value for each sphere, each contact, each measured mode
    lists = [(f"chain.{key}", getattr(chain, key), chain.count) for key in type(chain).model_fields]
    lists += [(f"contact.{key}", values, scene.n_contacts) for key, values in contact]
    if scene.guides:
        lists += [("guides.force", scene.guides.force, chain.count)]
    if scene.leaf_springs:
        lists += [(f"leaf_springs.{key}", x, chain.count) for key, x in scene.leaf_springs]
    if isinstance(scene.damping, ModalDampingTable):
        lists += [("damping.ratio", scene.damping.ratio, len(scene.measured_hz))]
    for key, value, n in lists:
        if isinstance(value, tuple) and len(value) != n:
            yield f"{key} has {len(value)} values, {n} are allowed; give one each."

    yield from _of_time(scene)

    # a dashpot gives way to a steady force, and a second dashpot in series has no law
    if gives_way(scene.wall):
        wall_kind = f'wall.kind = "{scene.wall.kind}"'
        if scene.preload and scene.preload.force > 0:
            yield (
                f"preload.force = {scene.preload.force} N with {wall_kind}, which gives way to any "
                "steady force; set it to 0, or take another wall."
            )
        last = contact.coefficient
        last = last[-1] if isinstance(last, tuple) else last
        if last > 0 and contact.dissipation != "none":
            yield (
                f"contact.coefficient is {last} at the wall, with {wall_kind} it must be 0 there; "
                "give a value for each contact, or drop it."
            )
    yield from of_gravity(scene)
    yield from of_friction(scene)
    yield from of_shakers(scene)

    if contact.law == "thornton":
        yield from of_yield(contact, "contact", chain.young)
        excluded = {
            f'wall.kind = "{scene.wall and scene.wall.kind}"': gives_way(scene.wall),
            f'{scene.strike_table}.weights = "thesis"': scene.strike is not None
            and scene.strike.weights == "thesis",
            "dashpots": scene.has_dashpots,
        }
        for excluder in (name for name, is_given in excluded.items() if is_given):
            yield f'contact.law = "thornton" is not marched with {excluder}; change one of them.'
    if contact.shaped and gives_way(scene.wall):
        yield (
            f'contact.law = "{contact.law}" is not marched with wall.kind = "{scene.wall.kind}"; '
            "change one of them."
        )
    if contact.file and (why := unfit(Path(contact.file))):
        yield f"contact.file = {contact.file!r} {why}; give a CSV of overlaps and forces."
    largest = contact.coefficient
    largest = max(largest) if isinstance(largest, tuple) else largest
    if contact.dissipation == "hunt-crossley" and largest > MAX_HUNT_CROSSLEY:
        yield (
            f"contact.coefficient = {largest:g} s/m, allowed with dissipation = "
            f'"hunt-crossley" is up to {MAX_HUNT_CROSSLEY:g} s/m; from some 1000 s/m on nothing '
            "rebounds, lower it."
        )

    if chain.initial_velocity is not None and scene.striker:
        yield "chain.initial_velocity replaces [striker]; drop one of them."
    at_rest = scene.striker is None and not any(chain.initial_velocity or ())
    if at_rest and not scene.shakers:
        yield "nothing moves; add [striker] velocity or chain.initial_velocity."
    spheres = scene.output.spheres
    if spheres and max(spheres) > chain.count:
        remedy = sorted({min(sphere, chain.count) for sphere in spheres})
        yield (
            f"output.spheres has {max(spheres)}, allowed are 1 to chain.count = {chain.count}; set "
            f'it too, --set output.spheres="{remedy}", or add spheres.'
        )
