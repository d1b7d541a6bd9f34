"""Keys of several chains that are each allowed but not together, a sentence each."""

from collections.abc import Iterator
from itertools import combinations

import numpy as np

from beadwave.system import free_memory
from beadwave.workflows.scene.places import sensor_places
from beadwave.workflows.scene.rig import RigScene, RigTable
from beadwave.workflows.scene.rules.bodies import same_names
from beadwave.workflows.scene.rules.contact import of_yield
from beadwave.workflows.scene.rules.friction import of_friction
from beadwave.workflows.scene.rules.shakers import of_shakers
from beadwave.workflows.scene.rules.size import INSTANT_BYTES, LIMITS, gigabytes
from beadwave.workflows.scene.scene import Scene
from beadwave.workflows.scene.tables.chains import ChainOnStructure
from beadwave.workflows.scene.tables.gravity import UPRIGHT

# tables of one chain, or of what is not marched for several
OTHERS = ("chain", "crystal", "wall", "guides")
MOST_CHAINS = 100  # each adds a column of the receptances and an oscillator
MOST_COMPARED = 1000  # spheres of a chain that are compared with those of others


def of_chains(scene: Scene) -> Iterator[str]:
    """Sentences on contradictions between [[chains]] and the rest of a scene."""
    chains = scene.chains
    for name in (name for name in OTHERS if getattr(scene, name) is not None):
        yield f"[{name}] is not of [[chains]], which lean on the faces of their `on`; drop it."
    if len(chains) > MOST_CHAINS:
        yield f"[[chains]] are {len(chains)}, allowed are {MOST_CHAINS}; drop some."
    yield from same_names(scene, "chains")
    if scene.assembly is None or isinstance(scene, RigScene):
        yield "[[chains]] lean on bodies; add [assembly] with [bodies], which they strike."
        return
    if isinstance(scene.assembly, RigTable):
        yield (
            "[[chains]] lean on bodies, [assembly] is the thesis' rig; describe it by "
            "[bodies.NAME]."
        )
        return

    # one basis for all contacts together, whose modes move one by one
    if scene.reduction.kind != "free-modes" or scene.reduction.error is None:
        yield (
            "[[chains]] are reduced to one error at all contacts together; give reduction.kind = "
            '"free-modes" and reduction.error.'
        )
    if scene.has_dashpots:
        yield "[[chains]] are not marched with dashpots and [[measured]] parts; drop these."

    if scene.gravity and scene.gravity.inclination != UPRIGHT:
        yield (
            "gravity.inclination is of one [chain], the faces of [[chains]] say how each lies; "
            "give gravity.direction, as [0, 0, -1]."
        )
    if scene.gravity and scene.floats:
        yield "[gravity] presses on an assembly without supports; hold it, or drop [gravity]."

    for row in chains:
        key = f"chains.{row.name}"
        contact = row.contact or scene.contact
        where = f"{key}.contact" if row.contact else "contact"
        yield from of_yield(contact, where, row.young)
        if contact.law == "thornton" and scene.shakers:
            yield (
                f'{where}.law = "thornton" has no periodic state, as contacts yield on the way to '
                'it; take "hertz" with [[shakers]].'
            )
        if contact.law not in ("hertz", "thornton"):
            yield f'{where}.law = "{contact.law}" is not of [[chains]]; take "hertz" or "thornton".'
        lists = [
            (f"{key}.{name}", getattr(row, name), row.count)
            for name in ("radius", "material", "density", "young", "poisson", "initial_velocity")
        ]
        leaf = row.leaf_springs or scene.leaf_springs
        lists += [(f"{key}: contact.{name}", x, row.count) for name, x in contact]
        lists += [(f"{key}: leaf_springs.{name}", x, row.count) for name, x in leaf or ()]
        for name, value, n in lists:
            if isinstance(value, tuple) and len(value) != n:
                yield f"{name} has {len(value)} values, {n} are allowed; give one each."
        if row.striker and row.striker.time >= scene.time.duration:
            yield (
                f"{key}.striker.time = {row.striker.time:g} s is not before the end, time.duration "
                f"= {scene.time.duration:g} s; lower the one or raise the other."
            )
        if row.initial_velocity is not None and row.striker:
            yield f"{key}.initial_velocity replaces {key}.striker; drop one of them."
        striker = row.striker or scene.striker
        if striker is not None and striker.velocity is None:
            yield "striker.drop is of a [chain] under [gravity]; give striker.velocity."
        if getattr(striker, "tangential_velocity", None):
            yield "striker.tangential_velocity is of one [chain] under [friction]; drop it."
            continue
        one = scene.of_each_chain[row.name]
        if one.friction and one.friction.upstream != "free" and not scene.shakers:
            yield (
                f"{key}: friction.upstream is of chains below which shakers move; add [[shakers]], "
                "or drop it."
            )
            continue
        for sentence in of_friction(one):
            yield f"{key}: {sentence}"
    yield from _overlapping(chains)
    yield from of_shakers(scene)
    if scene.shakers and sensor_places(scene):
        yield (
            "output.sensors on the structure are not computed for [[chains]] over [[shakers]]; "
            "take sensors of spheres, or drop them."
        )
    laws = {
        contact.dissipation
        for row in chains
        if (contact := row.contact or scene.contact).dissipation != "none" and contact.coefficient
    }
    if len(laws) > 1:
        yield f"[[chains]] are damped by {' and '.join(sorted(laws))}; give all one dissipation."
    still = [
        row for row in chains
        if not (row.striker or scene.striker or any(row.initial_velocity or ()))
    ]  # fmt: skip
    if len(still) == len(chains) and not scene.shakers:
        yield f"nothing moves; give chains.{chains[0].name}.striker a velocity."

    for row in chains:
        if row.output and max(row.output.spheres, default=0) > row.count:
            yield (
                f"chains.{row.name}.output.spheres has {max(row.output.spheres)}, the chain has "
                f"{row.count} spheres; lower it."
            )
    most = max(row.count for row in chains)
    if scene.output.spheres and max(scene.output.spheres) > most:
        yield (
            f"output.spheres has {max(scene.output.spheres)}, the longest of [[chains]] has "
            f"{most}; lower it."
        )
    values = sum(row.count for row in chains) * scene.output.samples
    needed = 6 * INSTANT_BYTES * values
    if values > LIMITS.values or needed > free_memory():
        yield (
            f"output.samples = {scene.output.samples} of all spheres of [[chains]] would take "
            f"{gigabytes(needed)} of memory; lower it, or drop spheres."
        )


def _overlapping(chains: tuple[ChainOnStructure, ...]) -> Iterator[str]:
    """Sentences on chains on one plane face whose spheres overlap; those of other faces are found
    on the mesh."""
    heights = []
    for row in chains:
        if row.count > MOST_COMPARED or np.size(row.radius) not in (1, row.count):
            return
        radius = np.broadcast_to(np.asarray(row.radius, float), row.count)
        # of the centres above the face, from the last sphere to the first
        above = np.cumsum(radius[::-1]) + np.append(0.0, np.cumsum(radius[:0:-1]))
        heights.append((radius[::-1], above))
    for (one, (R1, h1)), (other, (R2, h2)) in combinations(zip(chains, heights, strict=True), 2):
        if one.on != other.on or len(one.at) != 2 or len(other.at) != 2:
            continue
        apart = np.hypot(*np.subtract(one.at, other.at))
        if apart >= R1.max() + R2.max():
            continue
        gaps = np.hypot(apart, h1[:, None] - h2) - R1[:, None] - R2
        if gaps.min() < 0.0:
            yield (
                f"spheres of chains.{one.name} and chains.{other.name} overlap by "
                f"{-gaps.min():.3g} m; move one of them by its `at`."
            )
