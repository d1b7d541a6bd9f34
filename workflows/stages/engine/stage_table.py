"""The stages of a run, of every kind of scene: which functions, what they read, what they need.

A stage's first row whose `when` holds of a scene is the scene's. A need that a scene has no stage
for is not handed in: of a chain before a rigid wall the page needs no files of a model.
"""

from collections.abc import Callable, Sequence
from functools import lru_cache
from os import environ
from pathlib import Path
from typing import Any, NamedTuple

from beadwave.workflows.files import whole_file
from beadwave.workflows.files.foreign import Unreadable, require_memory
from beadwave.workflows.scene import InvalidScene, LossFactorsTable, MeasuredWall, RomWall, Scene
from beadwave.workflows.scene.named_files import files_of
from beadwave.workflows.scene.places import has_friction, named_faces, sensor_places, words_of


def always(scene: Scene) -> bool:
    """True of every scene."""
    return True


class Stage(NamedTuple):
    """One step: its function, what it reads of the scene, what it needs."""

    name: str
    function: str  # "room.module:name" of the stages, called with the scene and what it needs
    reads: Callable[[Scene], Any]
    needs: tuple[str, ...] = ()
    when: Callable[[Scene], bool] = always  # of which scenes
    kept: bool = True  # a quick stage with a large result is computed anew
    listed: bool = True  # among the times of a run
    transient: bool = False  # so large that it is freed once all its users are computed
    after: tuple[str, ...] = ()  # what it goes faster after, a second process may compute it
    # what it is computed with, handed in after what it needs: its result does not depend on it
    # but for rounding, so that a change of the contact keeps the modes
    means: tuple[str, ...] = ()
    # a stage whose result has this one's as well, `solved`: it is taken from there while that one
    # is in memory, which has computed it on the way
    within: str = ""


def needs_structure(scene: Scene) -> bool:
    """True if a run of this scene builds its finite elements."""
    if not scene.has_structure:
        return False
    return scene.chain is None or (isinstance(scene.wall, RomWall) and scene.wall.file is None)


def bent(scene: Scene) -> bool:
    """True of a beam or a plate."""
    return scene.bending is not None


def strikes_bodies(scene: Scene) -> bool:
    """True of a chain before a structure of bodies."""
    return bool(scene.chain) and needs_structure(scene) and not bent(scene)


def strikes_structure(scene: Scene) -> bool:
    """True of a chain before a structure that is reduced for it."""
    return bool(scene.chain) and needs_structure(scene)


def has_chain(scene: Scene) -> bool:
    """True of a chain."""
    return bool(scene.chain)


def has_chains(scene: Scene) -> bool:
    """True of several chains on one structure."""
    return bool(scene.chains)


def shakes_chains(scene: Scene) -> bool:
    """True of several chains on one structure that shakers move."""
    return bool(scene.chains) and bool(scene.shakers)


def has_crystal(scene: Scene) -> bool:
    """True of a crystal."""
    return scene.crystal is not None


def leans(scene: Scene) -> bool:
    """True of a crystal whose last row leans on a structure."""
    return has_crystal(scene) and scene.crystal.on is not None


def has_bodies(scene: Scene) -> bool:
    """True of a structure of bodies, which are meshed."""
    return needs_structure(scene) and not bent(scene)


def has_sizes_chosen(scene: Scene) -> bool:
    """True of bodies whose sizes of elements follow from an error asked of the mesh, in this run or
    in an earlier one."""
    return has_bodies(scene) and bool(scene.mesh.error or scene.mesh.sizes)


def has_measured_parts(scene: Scene) -> bool:
    """True of a structure with parts that are known by their receptances."""
    return bool(scene.measured)


def in_contact(scene: Scene) -> bool:
    """True of bodies whose faces are in contact under preload."""
    return any(joint.model == "contact" for joint in scene.bushings.values())


def has_bolts(scene: Scene) -> bool:
    """True of bodies with bolts that are known from their drawing, or with faces in contact."""
    return in_contact(scene) or any(joint.bolt is not None for joint in scene.bushings.values())


def slips(scene: Scene) -> bool:
    """True of a chain before a structure with faces in contact: friction in them changes frequency
    and damping of its modes in the run."""
    return strikes_structure(scene) and in_contact(scene) and not rubs_on_structure(scene)


def strikes_measured_part(scene: Scene) -> bool:
    """True of a chain before a structure with measured parts."""
    return bool(scene.measured and scene.chain)


def strikes_measured_wall(scene: Scene) -> bool:
    """True of a chain before a wall that is known by its receptance."""
    return bool(scene.chain) and isinstance(scene.wall, MeasuredWall)


def has_sensors(scene: Scene) -> bool:
    """True of chains with sensors on them, or on what they strike."""
    return bool((scene.chain or scene.chains) and scene.output.sensors)


def has_sensors_on_structure(scene: Scene) -> bool:
    """True of a chain with sensors on the structure that it strikes."""
    return bool(scene.chain) and has_sensors(scene) and bool(sensor_places(scene))


def rubs(scene: Scene) -> bool:
    """True of a chain whose last sphere rubs at a wall."""
    return bool(scene.chain and scene.friction)


def rubs_on_structure(scene: Scene) -> bool:
    """True of a chain whose last sphere rubs at a structure: one march along and across it."""
    return bool(scene.chain) and has_friction(scene)


def has_other_theories(scene: Scene) -> bool:
    """True of beams and plates for which `bending.other_theories` knows some: none of hollow and
    of open sections."""
    return bent(scene) and (scene.plate is not None or not (scene.beam.bore or scene.beam.area))


def tables_of(*tables: str) -> Callable[[Scene], Any]:
    """Input of a stage from a scene: these tables whole, and the files that they name."""
    return lambda scene: {name: _plain(getattr(scene, name)) for name in tables}


def _plain(table: Any) -> Any:
    """A table as JSON has it, with the contents of the files that it names."""
    if isinstance(table, tuple):
        return [_plain(entry) for entry in table]
    if isinstance(table, dict):
        return {name: _plain(entry) for name, entry in table.items()}
    if not hasattr(table, "model_dump"):
        return table
    contents = []
    for file in map(Path, files_of(table)):
        status = file.stat() if file.is_file() else None
        stamp = status and (status.st_mtime_ns, status.st_ctime_ns, status.st_size, status.st_ino)
        contents.append(_content_of(file.absolute(), stamp))
    return [table.model_dump(), contents] if contents else table.model_dump()


_wall_reads = tables_of("wall", "damping", "strike", "assembly")
_targets = tables_of("targets", "test_axes")


def _observed(scene: Scene) -> Any:
    """Spheres at which a run is observed, and the number of instants."""
    of_each = [row.output for row in scene.chains or ()]
    return [scene.output.spheres, scene.output.samples, of_each]


def _marched(scene: Scene) -> Any:
    """Input of a march besides chain and wall."""
    return [tables_of("time")(scene), _observed(scene)]


def _reduced(scene: Scene) -> Any:
    """Input of a reduction: its options, and the places where the structure is struck, shaken and
    observed."""
    tables = tables_of("reduction", "strike", "assembly")(scene)
    # loss factors ask for the shares of parts in the strain, whatever their values
    shared = ["strain"] if isinstance(scene.damping, LossFactorsTable) else []
    return [tables, words_of(scene), *shared]


def dimensions(scene: Scene) -> Any:
    """Input of a mesh: bodies, their contacts, sizes of elements, the faces that are named."""
    tables = tables_of(*BODIES, "mesh")(scene)
    if grids := scene.grids:
        # grid lines are prescribed: the mesh does not depend on the patch
        tables |= {"strike": [scene.strike.on, scene.strike.at], "grids": grids}
    if faces := sorted(named_faces(scene).items()):
        tables |= {"faces": faces}
    if scene.chains:
        tables |= {"places": _places(scene)}
    return tables


def _places(scene: Scene) -> Any:
    """Places that several chains strike, and whether they rub there."""
    return [
        (row.name, row.on, row.at, row.patch_radius, bool(row.friction or scene.friction))
        for row in scene.chains or ()
    ]


def _each_chain(scene: Scene) -> Any:
    """Input of a march of several chains besides the structure."""
    tables = tables_of(
        "chains", "striker", "contact", "leaf_springs", "preload", "gravity", "friction", "arm"
    )  # fmt: skip
    return [tables(scene), _marched(scene)]


def _shaken_wall(scene: Scene) -> Any:
    """Input of a structure under its shakers."""
    return [_wall_reads(scene), tables_of("shakers")(scene)]


def _shaken_chains(scene: Scene) -> Any:
    """Input of a march of several chains from the periodic state that shakers keep up."""
    return [_each_chain(scene), tables_of("shakers")(scene)]


def content(path: str | Path) -> str | None:
    """A digest of a file's content; None where there is none. Raises InvalidScene for one that
    memory has no room for."""
    if not Path(path).is_file():
        return None
    try:
        require_memory(Path(path))
    except Unreadable as error:
        raise InvalidScene(f"{path}: {error}; give a smaller file.") from None
    return whole_file.digest(Path(path))


@lru_cache(maxsize=256)  # several stages read the tables that name a file
def _content_of(path: Path, stamp: tuple[int, ...] | None) -> str | None:
    return content(path)


BENT = ("beam", "plate")
BODIES = ("assembly", "bodies", "materials", "ties", "joints", "strike", "loads")


def _chosen(scene: Scene) -> Any:
    """Input of the search for sizes of elements."""
    return [read(scene.sizes_of) for read in (dimensions, joined, _targets)]


def joined(scene: Scene) -> Any:
    """Joints of the bodies, and their partners."""
    tables = tables_of("assembly", "joints", "table", "masses", "springs", "measured")(scene)
    if scene.measured:
        tables["test_axes"] = _plain(scene.test_axes)
    return tables


def _coarse(scene: Scene) -> Any:
    """Joints and strike of a second mesh; its bodies are in the key of the mesh."""
    return [joined(scene), tables_of("strike")(scene)]


START = (
    "chain", "striker", "contact", "leaf_springs", "preload", "gravity", "guides", "wall", *BENT,
    *BODIES,
)  # fmt: skip


def _shown(scene: Scene) -> Any:
    """Input of the page besides what it needs."""
    return [scene.name, tables_of("output")(scene)]


_rubbing = tables_of("friction", "arm", "shakers", "striker")


def _across(scene: Scene) -> Any:
    """Input of a march across the chain."""
    return [_marched(scene), _rubbing(scene)]


def _compiled(scene: Scene) -> Any:
    """Input of compilation: chain and wall that kernels are for, and the place of their code."""
    return [environ.get("NUMBA_CACHE_DIR"), tables_of("damping")(scene), tables_of(*START)(scene)]


CAUSES = "reduction", "mesh", "theory", "receptance"  # of the errors of an impact


STAGES = (
    # the structure: bodies
    Stage(
        "search", ".errors.adapted_sizes:search", _chosen, when=has_sizes_chosen,
        kept=False, transient=True,
    ),
    Stage(
        "sizes", ".errors.adapted_sizes:adapted_sizes", tables_of(), ("search",),
        when=has_sizes_chosen, listed=False,
    ),
    Stage(
        "mesh", ".structure.assembly:mesh", dimensions, ("sizes",), kept=False, within="search"
    ),
    Stage("model", ".structure.bending:model", tables_of(*BENT), when=bent, kept=False),
    Stage(
        "model", ".structure.assembly:model", joined, ("mesh",), kept=False, within="search"
    ),
    Stage("tuning-basis", ".structure.assembly:tuning_basis", _targets, ("model",)),
    Stage(
        "factor", ".structure.assembly:factor", tables_of(), ("model",), kept=False, transient=True,
        within="search",
    ),
    Stage(
        "krylov-space", ".structure.krylov_space:krylov_space",
        lambda scene: [_targets(scene), tables_of("reduction", "strike")(scene)],
        ("mesh", "model", "factor"), kept=False, transient=True, within="search",
    ),
    Stage("modes", ".structure.bending:modes", tables_of(), ("model",), when=bent),
    Stage(
        "modes", ".structure.assembly:modes", _targets, ("model",), means=("krylov-space",),
        within="search",
    ),
    Stage(
        "joint-bounds", ".structure.joint_bounds:joint_bounds", tables_of(),
        ("mesh", "model", "modes"), when=has_bolts,
    ),
    Stage(
        "backbones", ".structure.backbones:backbones", tables_of(), ("mesh", "model", "modes"),
        when=has_bolts,
    ),
    Stage(
        "contact-numbers", ".structure.contact_zone:contact_numbers", tables_of(),
        ("mesh", "model"), when=in_contact, listed=False,
    ),
    Stage(
        "contact-files", ".structure.contact_zone:contact_files", tables_of(), ("model",),
        when=in_contact, listed=False,
    ),
    Stage("mac", ".structure.bending:mac", tables_of(), ("modes",), when=bent, listed=False),
    Stage(
        "mac", ".structure.rigid_joint_mac:mac", tables_of(), ("mesh", "model", "modes"),
        means=("factor", "krylov-space"),
    ),
    Stage(
        "contact", ".structure.bending:contact", tables_of(), ("model",),
        when=bent, kept=False, listed=False,
    ),
    Stage(
        "contact", ".structure.assembly:contact", tables_of("strike"), ("mesh", "model"),
        within="search",
    ),
    Stage(
        "surface", ".structure.strike:surface", tables_of(), ("mesh",),
        when=strikes_bodies, listed=False,
    ),
    Stage(
        "participation", ".structure.assembly:participation", tables_of(), ("contact", "modes"),
        listed=False,
    ),
    Stage("reduction", ".structure.bending:reduction", tables_of("reduction"), ("model",), bent),
    Stage(
        "chain-contacts", ".structure.several:contacts", _places, ("mesh", "model"),
        when=has_chains,
    ),
    Stage(
        "reduction", ".structure.several:reduction",
        lambda scene: [_reduced(scene), _places(scene)],
        ("model", "modes", "chain-contacts"), when=has_chains, means=("factor",),
    ),
    Stage(
        "row-contacts", ".crystal.structure:contacts", tables_of("crystal", "friction"),
        ("mesh", "model", "contact"), when=leans,
    ),
    Stage(
        "reduction", ".crystal.structure:reduction", _reduced,
        ("model", "contact", "modes", "row-contacts"), when=leans, means=("factor",),
    ),
    Stage(
        "reduction", ".structure.reduction:reduction", _reduced, ("model", "contact", "modes"),
        means=("factor", "krylov-space", "half-space"),
    ),
    Stage(
        "half-space", ".structure.reduction:half_space", tables_of("strike"), ("mesh", "model"),
        listed=False, within="search",
    ),
    Stage("full-response", ".structure.response:full_response", tables_of(), ("model", "contact"),
        when=bent),
    Stage(
        "full-response", ".structure.response:full_response", tables_of(), ("model", "contact"),
        means=("factor", "krylov-space"),
    ),
    Stage(
        "response", ".structure.response:response", tables_of("damping"),
        ("full-response", "reduction"),
    ),
    Stage(
        "structure-numbers", ".structure.health:structure_numbers", tables_of("targets"),
        ("modes", "reduction", "participation"), listed=False,
    ),
    Stage(
        "spatial-wall", ".structure.friction:spatial_wall",
        _shaken_wall, ("reduction",),
        when=lambda scene: rubs_on_structure(scene) and strikes_structure(scene),
    ),
    Stage(
        "spatial-wall", ".structure.friction:spatial_wall",
        _shaken_wall, when=rubs_on_structure,
    ),
    # errors of the structure
    Stage(
        "static-shape", ".errors.mesh_error:static_shape", tables_of("reduction", "strike"),
        ("mesh", "model", "modes"), means=("krylov-space",), listed=False,
    ),
    Stage(
        "second-mesh", ".structure.bending:second_mesh", tables_of(*BENT, "reduction"), when=bent
    ),
    Stage("second-mesh", ".errors.second_mesh:second_mesh", _coarse, ("mesh",)),
    Stage(
        "other-theories", ".structure.bending:other_theories", tables_of(*BENT, "reduction"),
        when=bent,
    ),
    Stage(
        "missed-energy", ".errors.mesh_error:missed_by_mesh", tables_of("reduction", "strike"),
        ("mesh", "model", "modes"), means=("static-shape", "half-space"),
    ),
    Stage(
        "mesh-numbers", ".errors.adapted_sizes:mesh_numbers", tables_of("mesh"),
        ("sizes", "mesh", "modes", "missed-energy"), when=has_sizes_chosen, listed=False,
    ),
    Stage(
        "part-errors", ".errors.part_fit_errors:part_errors", tables_of(), ("model", "modes"),
        when=has_measured_parts,
    ),
    Stage(
        "structure-errors", ".errors.bending_errors:structure_errors", tables_of(),
        ("modes", "reduction", "second-mesh", "other-theories"), when=has_other_theories,
    ),
    Stage(
        "structure-errors", ".errors.bending_errors:structure_errors", tables_of(),
        ("modes", "reduction", "second-mesh"), when=bent,
    ),
    Stage(
        "structure-errors", ".structure.health:structure_errors", tables_of(),
        ("modes", "missed-energy", "structure-numbers", "part-errors"), listed=False,
    ),
    # the impact
    Stage(
        "compilation", ".chain.friction:compilation",
        lambda scene: [_compiled(scene), _rubbing(scene)], when=rubs,
    ),
    Stage("compilation", ".engine.compilation:compilation", _compiled),
    Stage(
        "wall", ".structure.friction:wall_along", tables_of(), ("spatial-wall",),
        when=rubs_on_structure, kept=False,
    ),
    Stage(
        "amplitudes", ".structure.amplitudes:amplitudes",
        lambda scene: [_wall_reads(scene), _marched(scene)],
        ("start", "reduction", "modes", "backbones"), when=slips, after=("compilation",),
    ),
    Stage(
        "wall", ".chain.walls:wall_of", _wall_reads, ("reduction", "amplitudes"),
        when=strikes_structure,
    ),
    Stage("wall", ".chain.walls:wall_of", _wall_reads),
    Stage("start", ".chain.chain:start", tables_of(*START), ("surface",), listed=False),
    Stage("march", ".structure.friction:march", _across, ("start", "spatial-wall"),
        when=rubs_on_structure),
    Stage(
        "impact", ".structure.friction:impact", tables_of(), ("start", "wall", "march"),
        when=rubs_on_structure, kept=False,
    ),
    Stage("impact", ".chain.impact:impact", _marched, ("start", "wall"), after=("compilation",)),
    Stage(
        "friction", ".structure.friction:across", tables_of(), ("march",),
        when=rubs_on_structure, kept=False,
    ),
    Stage(
        "friction", ".chain.friction:friction", _across, ("start", "wall", "impact"),
        when=rubs, after=("compilation",),
    ),
    Stage("waves", ".chain.waves:waves", _observed, ("start", "impact")),
    Stage(
        "record", ".chain.sensor_signals:record_of_chains", tables_of("output", "damping"),
        ("chains-waves", "reduction", "chain-contacts"),
        when=lambda scene: has_chains(scene) and has_sensors(scene),
        kept=False, listed=False,
    ),
    Stage(
        "record", ".structure.friction:record", tables_of("output", "shakers"),
        ("start", "spatial-wall", "march", "impact", "waves"),
        when=lambda scene: rubs_on_structure(scene) and has_sensors_on_structure(scene),
        kept=False, listed=False,
    ),
    Stage(
        "record", ".chain.sensor_signals:record", tables_of("output", "damping"),
        ("impact", "waves", "reduction", "amplitudes"), when=has_sensors_on_structure,
        kept=False, listed=False,
    ),
    Stage(
        "record", ".chain.sensor_signals:record", tables_of("output"), ("impact", "waves"),
        when=has_sensors, kept=False, listed=False,
    ),
    Stage(
        "sensor-numbers", ".chain.sensor_signals:sensor_waves", tables_of("output"), ("record",),
        when=has_sensors, listed=False,
    ),
    Stage(
        "chain-numbers", ".chain.friction:chain_numbers", _marched,
        ("start", "wall", "impact", "waves", "friction"), when=rubs, listed=False,
    ),
    Stage(
        "chain-numbers", ".chain.chain_numbers:chain_numbers", _marched,
        ("start", "wall", "impact", "waves"), listed=False,
    ),
    # several chains
    Stage(
        "structure", ".chain.several:structure", _shaken_wall, ("reduction", "chain-contacts"),
        when=has_chains, kept=False, listed=False,
    ),
    Stage(
        "chains", ".chain.several:start", _each_chain, ("chain-contacts", "structure"),
        when=has_chains, kept=False, listed=False,
    ),
    Stage(
        "chains-before", ".chain.several:state_before", _shaken_chains, ("chains", "structure"),
        when=shakes_chains,
    ),
    Stage(
        "chains-march", ".chain.several:march", _each_chain,
        ("chains", "structure", "chains-before"), when=has_chains,
    ),
    Stage(
        "chains-waves", ".chain.several:waves", _observed,
        ("chains", "structure", "chains-march", "chains-before"), when=has_chains,
    ),
    Stage(
        "chains-errors", ".chain.several:reduction_errors", _shaken_chains,
        ("chains", "structure", "chains-march", "reduction", "chain-contacts", "chains-before"),
        when=has_chains,
    ),
    Stage(
        "chains-mesh-errors", ".errors.chains_mesh_error:mesh_errors",
        lambda scene: [
            read(scene) for read in (joined, _reduced, _wall_reads, _places, _shaken_chains)
        ],
        ("chains", "chains-march", "mesh", "modes", "chains-before"), when=has_chains,
    ),
    Stage(
        "chains-numbers", ".chain.several_numbers:chains_numbers", _marched,
        ("chains", "structure", "chains-march", "chains-waves"), when=has_chains, listed=False,
    ),
    Stage(
        "chains-files", ".chain.several_numbers:chains_files", tables_of("output"),
        ("chains", "structure", "chains-march", "chains-waves", "record"),
        when=has_chains, listed=False,
    ),
    Stage(
        "chains-figures", ".pages.figures:of_chains", _observed, ("chains-march", "chains-waves"),
        when=has_chains,
    ),
    # a crystal
    Stage(
        "crystal", ".crystal.packing:start",
        tables_of(
            "crystal", "contact", "wall", "friction", "gravity", "time", "bodies", "materials"
        ),
        when=has_crystal, kept=False, listed=False,
    ),
    Stage(
        "structure", ".crystal.structure:structure", _wall_reads, ("reduction", "row-contacts"),
        when=leans, kept=False, listed=False,
    ),
    Stage(
        "crystal-march", ".crystal.march:march", tables_of("time", "output", "wall"),
        ("crystal", "structure"), when=has_crystal,
    ),
    Stage(
        "crystal-error", ".crystal.structure:reduction_error", tables_of("time", "output"),
        ("crystal", "crystal-march", "reduction", "row-contacts"), when=leans,
    ),
    Stage(
        "crystal-modes", ".crystal.linear:crystal_modes", tables_of("crystal"), ("crystal",),
        when=has_crystal,
    ),
    Stage(
        "arrivals", ".crystal.numbers:waves", tables_of(), ("crystal", "crystal-march"),
        when=has_crystal, listed=False,
    ),
    Stage(
        "crystal-numbers", ".crystal.numbers:crystal_numbers",
        tables_of("crystal", "contact", "wall"), ("crystal", "crystal-march", "arrivals"),
        when=has_crystal, listed=False,
    ),
    Stage(
        "crystal-files", ".crystal.numbers:crystal_files", tables_of(),
        ("crystal", "crystal-march", "arrivals"), when=has_crystal, listed=False,
    ),
    Stage(
        "crystal-figures", ".crystal.figures:crystal_figures", tables_of("crystal"),
        ("crystal", "crystal-march", "arrivals"), when=has_crystal,
    ),
    # errors of the impact: better walls by cause, marches before them, what these differ by
    Stage(
        "better-reduction", ".errors.better_walls:of_reduction", _wall_reads,
        ("reduction", "amplitudes"), kept=False, listed=False,
    ),
    Stage(
        "better-mesh", ".errors.better_walls:of_second_mesh", _wall_reads, ("second-mesh",),
        when=bent, kept=False, listed=False,
    ),
    Stage(
        "better-mesh", ".errors.better_walls:of_missed_energy", _wall_reads,
        ("missed-energy", "reduction"), kept=False, listed=False,
    ),
    Stage(
        "better-theory", ".errors.better_walls:of_other_theories", _wall_reads,
        ("other-theories",), when=bent, kept=False, listed=False,
    ),
    Stage(
        "better-receptance", ".errors.better_walls:of_receptance", _wall_reads,
        when=strikes_measured_wall, kept=False, listed=False,
    ),
    Stage(
        "better-receptance", ".errors.better_walls:of_measured_parts",
        lambda scene: [_wall_reads(scene), _coarse(scene)], ("mesh",),
        when=strikes_measured_part, kept=False, listed=False,
    ),
    *(
        Stage(
            f"{cause}-marches", ".errors.better_walls:marched", tables_of(),
            ("start", "impact", f"better-{cause}"), kept=False, listed=False,
        )
        for cause in CAUSES
    ),
    *(
        Stage(
            f"{cause}-error", ".errors.better_walls:velocity_error", _marched,
            ("start", f"{cause}-marches"),
        )
        for cause in CAUSES
    ),
    Stage(
        "quantity-errors", ".errors.number_errors:number_errors", _marched,
        ("start", "impact", "waves", "receptance-marches"),
        when=strikes_measured_wall, listed=False,
    ),
    Stage(
        "quantity-errors", ".errors.number_errors:number_errors", _marched,
        ("start", "impact", "waves", "reduction-marches", "mesh-marches", "theory-marches"),
        when=lambda scene: strikes_structure(scene) and has_other_theories(scene),
    ),
    Stage(
        "quantity-errors", ".errors.number_errors:number_errors", _marched,
        ("start", "impact", "waves", "reduction-marches", "mesh-marches"),
        when=lambda scene: strikes_structure(scene) and bent(scene),
    ),
    Stage(
        "quantity-errors", ".errors.better_walls:explained_number_errors", _marched,
        ("start", "impact", "waves", "missed-energy", "reduction-marches", "mesh-marches"),
        when=strikes_structure,
    ),
    Stage(
        "quantity-errors", ".errors.number_errors:number_errors", _marched,
        ("start", "impact", "waves"), listed=False,
    ),
    # files, pictures and the page
    Stage(
        "size-files", ".structure.files:size_files", tables_of(), ("sizes",),
        when=has_sizes_chosen, listed=False,
    ),
    Stage("mode-files", ".structure.files:mode_files", tables_of(), ("modes",), listed=False),
    Stage(
        "model-files", ".structure.files:model_files", tables_of("damping"), ("reduction",),
        listed=False,
    ),
    Stage(
        "response-files", ".structure.files:response_files", tables_of(), ("response",),
        listed=False,
    ),
    Stage(
        "chain-files", ".chain.friction:chain_files", tables_of("output"),
        ("impact", "wall", "friction", "record"), when=rubs, listed=False,
    ),
    Stage(
        "chain-files", ".chain.chain_numbers:chain_files", tables_of("output"),
        ("impact", "wall", "record"), listed=False,
    ),
    Stage("pictures", ".pages.pictures:pictures_of_plate", tables_of(), ("modes", "contact"),
        when=bent),
    Stage(
        "missed-files", ".structure.files:missed_files", tables_of(), ("mesh", "missed-energy"),
        when=has_bodies, listed=False,
    ),
    Stage(
        "pictures", ".pages.pictures:pictures", tables_of(), ("mesh", "modes", "contact"),
        means=("missed-energy",),
    ),
    Stage(
        "figures", ".pages.figures:of_friction", _observed, ("impact", "waves", "friction"),
        when=rubs,
    ),
    Stage("figures", ".pages.figures:of_chain", _observed, ("impact", "waves")),
    Stage(
        "signals", ".pages.figures:signals", tables_of("output"), ("record",),
        when=has_sensors, kept=False, listed=False,
    ),
    Stage(
        "page", ".pages.page:data", _shown,
        ("chain-files", "chain-numbers", "model-files", "response-files", "structure-numbers"),
        when=strikes_structure, listed=False,
    ),
    Stage(
        "page", ".pages.page:data", _shown, ("chain-files", "chain-numbers"),
        when=has_chain, listed=False,
    ),
    Stage(
        "page", ".pages.page:data", _shown,
        ("chains-files", "chains-numbers", "model-files", "response-files", "structure-numbers"),
        when=has_chains, listed=False,
    ),
    Stage(
        "page", ".pages.page:data", _shown,
        ("crystal-files", "crystal-numbers", "model-files", "response-files", "structure-numbers"),
        when=leans, listed=False,
    ),
    Stage(
        "page", ".pages.page:data", _shown, ("crystal-files", "crystal-numbers"),
        when=has_crystal, listed=False,
    ),
    Stage(
        "page", ".pages.page:data", _shown,
        ("model-files", "response-files", "structure-numbers"), listed=False,
    ),
)  # fmt: skip


def stages_of(scene: Scene, further: Sequence[Stage] = ()) -> dict[str, Stage]:
    """The stages that a run of this scene may ask for, by their names, `further` ones in place of
    those of the same name; what it never asks for costs nothing."""
    chosen: dict[str, Stage] = {}
    for stage in (*further, *STAGES):
        if stage.name not in chosen and stage.when(scene):
            chosen[stage.name] = stage
    return {
        name: stage._replace(needs=tuple(need for need in stage.needs if need in chosen))
        for name, stage in chosen.items()
    }
