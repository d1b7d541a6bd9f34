"""Structures: bodies looked at, modes, tuned joints, hammer tests, reduced models."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from beadwave.system import adding, file_name
from beadwave.workflows.files.hammer import HAMMER
from beadwave.workflows.files.output_file import OutputFile, output_files
from beadwave.workflows.files.picture_folder import picture_folder
from beadwave.workflows.files.run_folder import NoPicture, Picture, picture_named, write_pictures
from beadwave.workflows.files.scene import Changes, Source, files_read
from beadwave.workflows.files.scene import scene as load_scene
from beadwave.workflows.scene import InvalidScene, Scene
from beadwave.workflows.scene.named_files import require_file
from beadwave.workflows.scene.required_parts import (
    with_assembly,
    with_mac,
    with_rig,
    with_structure,
    with_targets,
)
from beadwave.workflows.scene.rig import RigScene
from beadwave.workflows.stages.engine.progress import Progress, quiet

if TYPE_CHECKING:
    import xarray
    from numpy.typing import ArrayLike
    from scipy.sparse import sparray

    from beadwave.fem.identification.poly_reference import IdentifiedModes
    from beadwave.rom import ReducedModel
    from beadwave.workflows.report.summary import MeshNumbers
    from beadwave.workflows.stages.engine.pipeline import Pipeline
    from beadwave.workflows.structure.crystal_modes import CrystalModeTable
    from beadwave.workflows.structure.hammer import HammerReport
    from beadwave.workflows.structure.hammer_design import HammerDesign
    from beadwave.workflows.structure.look import Look, LookContents
    from beadwave.workflows.structure.losses import LossReport
    from beadwave.workflows.structure.mode_table import ModeTable
    from beadwave.workflows.structure.ranking import RankReport
    from beadwave.workflows.structure.response_report import ResponseReport
    from beadwave.workflows.structure.thesis_tables import ThesisTable
    from beadwave.workflows.structure.tuning import TuningReport

HAMMER_PICTURES = ("hammer", "synthesis", "coherence", "decay", "automac", "mac", "shapes")


@dataclass(frozen=True, repr=False)
class LookReport:
    """An assembly at a glance: `found.bodies`, `found.touching`, `found.holes`, ..."""

    found: Look
    seen: LookContents

    def plot(self) -> Picture:
        """The bodies, a colour and a name each; of a scene with chain, joints and held faces."""
        from beadwave.workflows.stages.pages.pictures import picture_of, picture_of_parts

        seen = self.seen
        if seen.parts is not None:
            return picture_of_parts(seen.scene, seen.parts)
        if not seen.surfaces:
            from beadwave.workflows.structure.look import look

            seen = look(seen.scene, seen.look.name, whole=seen.whole, pictured=True)
        return picture_of(seen.surfaces, seen.fixtures)

    def __repr__(self) -> str:
        return self.found.text()


def look(
    source: Source,
    changes: Changes = (),
    *,
    mesh: bool = False,
    starter: str | Path | None = None,
    out: str | Path | None = None,
    overwrite: bool = False,
    progress: Progress = quiet,
) -> LookReport:
    """Bodies, masses, touching pairs, holes and the size of the mesh (`beadwave look`).

    source   a STEP file, or a scene with an assembly
    mesh     make the mesh, which counts its nodes, shows springs and masses in the picture, and
             refuses what cannot be meshed
    starter  write a scene of the STEP file to start from
    out      folder for the picture with the names, and for faces.html, on which a click on a face
             shows the selectors that pick it

    Raises InvalidScene for bad input.
    """
    from beadwave.workflows.structure import look as looking
    from beadwave.workflows.structure.template import write_starter

    path = Path(source) if isinstance(source, str | Path) else None
    is_step = path is not None and path.suffix.lower() in looking.ENDINGS
    scene = looking.of_file(path) if is_step else load_scene(source, changes)
    if starter and not is_step:
        raise InvalidScene(f"--scene starts a scene of a STEP file; {source} is a scene already.")
    inputs = (path,) if path else ()
    options = {"inputs": inputs, "ending": ".toml", "overwrite": overwrite}
    file = OutputFile(starter, "--scene", **options) if starter else None
    folder = picture_folder(out, inputs, overwrite, "assembly")
    if folder:
        folder.require("faces.html")
    with progress("look"):
        title = str(source) if path else scene.name
        glance = looking.look(
            with_assembly(scene), title, whole=not is_step, meshed=mesh,
            with_starter=file is not None, pictured=folder is not None,
        )  # fmt: skip
        result = LookReport(glance.look, glance)
        if folder:
            write_pictures(folder, (result.plot(),))
            folder.write("faces.html", glance.page.encode())
    if file:
        write_starter(file, glance.starter, path)
    return result


@dataclass(frozen=True, repr=False)
class ModesOfScene:
    """Modes of an assembly: `table.rows` one by one, `data` as arrays, `plot()` their MAC."""

    scene: Scene
    table: ModeTable
    pipeline: Pipeline

    @property
    def data(self) -> xarray.Dataset:
        """frequency [Hz] and participation at the contact [kg^-1/2] over mode; mac over mode and
        target, with the modes of stiff joints."""
        from beadwave.workflows.report.arrays import dataset

        rows, mac = self.table.rows, self.pipeline("mac")
        per_mode = {
            "frequency": (("mode",), np.array([r.frequency_hz for r in rows]), "Hz"),
            "participation": (
                ("mode",),
                np.array([r.participation for r in rows], float),
                "kg^-1/2",
            ),
        }
        numbers = {"mode": [row.number for row in rows], "target": np.arange(1, mac.shape[1] + 1)}
        return dataset(per_mode | {"mac": (("mode", "target"), mac, "1")}, **numbers)

    def plot(self) -> Picture:
        """The MAC matrix with the modes of stiff joints; raises InvalidScene without targets."""
        from beadwave.workflows.structure.mode_table import mac_picture

        return mac_picture(self.pipeline)

    def __repr__(self) -> str:
        return self.table.text()


@dataclass(frozen=True, repr=False)
class ModesOfCrystal:
    """Modes of a crystal: `table.rows` one by one, `data` as arrays, `plot()` the dispersion of its
    lattice beside them."""

    scene: Scene
    table: CrystalModeTable
    pipeline: Pipeline

    @property
    def data(self) -> xarray.Dataset:
        """frequency [Hz] over mode, shape [kg^-1/2] over mode, sphere and axis."""
        from beadwave.workflows.report.arrays import dataset

        modes, start = self.pipeline("crystal-modes"), self.pipeline("crystal")
        still = self.table.n_still
        variables = {
            "frequency": (("mode",), modes.frequency[still:], "Hz"),
            "shape": (("mode", "sphere", "axis"), modes.shape[still:], "kg^-1/2"),
        }
        numbers = [row.number for row in self.table.rows]
        return dataset(variables, mode=numbers, sphere=start.number, axis=["x", "y", "z"])

    def plot(self) -> Picture:
        """Frequency over wave number along each axis, and the crystal's modes."""
        from beadwave.workflows.structure.crystal_modes import dispersion_picture

        return dispersion_picture(self.table)

    def __repr__(self) -> str:
        return self.table.text()


def modes(
    scene: Source = None,
    changes: Changes = (),
    *,
    amplitude: bool = False,
    out: str | Path | None = None,
    overwrite: bool = False,
    progress: Progress = quiet,
) -> ModesOfScene | ModesOfCrystal:
    """Frequencies, measured ones, MAC, participation at the contact (`beadwave modes`); of a
    pressed crystal its modes, and bands and dispersion of its lattice.

    amplitude  frequency and loss factor of the six lowest elastic modes over their amplitude, of
               faces in contact under preload
    out  folder for the picture of the MAC matrix, of a crystal for its dispersion, and of faces in
         contact under preload their zone and pressure, with contact.npz

    Raises InvalidScene for bad input, a scene without an assembly, a crystal that nothing presses
    and amplitudes without faces in contact, ValueError where a computation fails.
    """
    chosen = load_scene(scene, changes)
    bolted = [name for name, joint in chosen.bushings.items() if joint.bolt]
    if amplitude and not any(joint.model == "contact" for joint in chosen.bushings.values()):
        remedy = f"--set joints.{bolted[0]}.model=contact" if bolted else "[[joints]] need a bolt"
        raise InvalidScene(
            f"--amplitude is of faces in contact under preload, {chosen.name} has none; {remedy}."
        )
    if chosen.crystal:
        return _modes_of_crystal(chosen, scene, out, overwrite, progress)
    chosen = with_structure(chosen)
    in_contact = any(joint.model == "contact" for joint in chosen.bushings.values())
    pictures = {
        "mac": bool(chosen.measured_hz), "contact": in_contact, "amplitude": amplitude,
        "slip": amplitude,
    }  # fmt: skip
    names = [name for name, drawn in pictures.items() if drawn]
    if out is not None and not names:
        with_mac(chosen)
    folder = picture_folder(out, files_read(chosen, scene), overwrite, *names)
    from beadwave.workflows.stages.engine.pipeline import pipeline_of
    from beadwave.workflows.structure.mode_table import mode_table

    pipeline = pipeline_of(chosen, progress)
    result = ModesOfScene(chosen, mode_table(pipeline, amplitude=amplitude), pipeline)
    if folder and "mac" in names:
        write_pictures(folder, (result.plot(),))
    if folder and in_contact:
        from beadwave.workflows.stages.structure.contact_zone import contact_arrays, contact_picture
        from beadwave.workflows.structure import amplitude_table

        contact, slip = pipeline("model").contact, {}
        write_pictures(folder, (contact_picture(contact),))
        if amplitude:
            of_mode = pipeline("backbones")
            slip["slip_displacement"] = amplitude_table.slip_displacements(of_mode)
            curves = amplitude_table.amplitude_picture(result.table.amplitude or ())
            write_pictures(folder, (curves, amplitude_table.slip_picture(contact, of_mode)))
        folder.write("contact.npz", contact_arrays(contact, **slip))
    return result


def _modes_of_crystal(
    chosen: Scene, scene: Source, out: str | Path | None, overwrite: bool, progress: Progress
) -> ModesOfCrystal:
    """`modes` of a crystal."""
    folder = picture_folder(out, files_read(chosen, scene), overwrite, "dispersion")
    from beadwave.workflows.stages.engine.pipeline import pipeline_of
    from beadwave.workflows.structure.crystal_modes import crystal_mode_table

    pipeline = pipeline_of(chosen, progress)
    result = ModesOfCrystal(chosen, crystal_mode_table(pipeline), pipeline)
    if folder:
        write_pictures(folder, (result.plot(),))
    return result


TABLES = ("5.2", "5.3")  # of the thesis, that can be computed again


def thesis_table(
    table: str,
    scene: Source = None,
    changes: Changes = (),
    *,
    out: str | Path | None = None,
    overwrite: bool = False,
    progress: Progress = quiet,
) -> ThesisTable:
    """Table 5.2 (models of ties) or 5.3 (tuned joints) of the thesis computed again, with its
    numbers (`beadwave modes --table`); `out` gets the picture of 5.2, what each part changes."""
    if table not in TABLES:
        raise InvalidScene(f"--table {table} is not known; known are {' and '.join(TABLES)}.")
    chosen = with_rig(load_scene(scene, changes))
    from beadwave.workflows.structure.thesis_tables import effects, table_52, table_53

    if table == "5.3":
        return table_53(chosen, progress)
    folder = picture_folder(out, files_read(chosen, scene), overwrite, "component_effects")
    result = table_52(chosen, progress)
    if folder:
        write_pictures(folder, (effects(result),))
    return result


def export(
    scene: Source = None,
    changes: Changes = (),
    *,
    inp: str | Path | None = None,
    step: str | Path | None = None,
    overwrite: bool = False,
    progress: Progress = quiet,
) -> list[Path]:
    """The model as an input deck for CalculiX or Abaqus, the geometry as STEP; the files written
    (`beadwave modes --inp --step`). Files that beadwave did not write, or that were changed since,
    are only replaced with `overwrite`."""
    chosen = with_assembly(load_scene(scene, changes))
    options = {"--inp": inp, "--step": step}
    files = output_files(options, inputs=files_read(chosen, scene), overwrite=overwrite)
    from beadwave.workflows.stages.engine.pipeline import pipeline_of
    from beadwave.workflows.structure.export import write_model

    write_model(pipeline_of(chosen, progress), files.get("--inp"), files.get("--step"))
    return [file.path for file in files.values()]


USUAL = Path("NAME-tuned.toml")


@dataclass(frozen=True, repr=False)
class TuningResult:
    """The scene with fitted joints, its report, and the file it was written to, if any."""

    scene: Scene
    report: TuningReport
    file: Path | None

    def __repr__(self) -> str:
        return self.report.text()


def tune(
    scene: Source = None,
    changes: Changes = (),
    *,
    hammer: str | Path | None = None,
    match: str | Iterable[int] | Mapping[int, float] | None = None,
    free: str | Iterable[str] = (),
    out: str | Path | None = None,
    overwrite: bool = False,
    progress: Progress = quiet,
) -> TuningResult:
    """Joint stiffnesses, and materials, fitted to measured modes (`beadwave tune`).

    hammer  a hammer test (.csv, .uff, .mat, .wav) to take frequencies and damping from; in a scene
            of bodies without targets its modes become the targets, by shape where points are known
    match   modes to meet, as 1,3,4, or with frequencies in Hz, as 1=51.2,3=905; default all targets
            of the scene. In a scene of bodies without targets the numbers count its computed modes,
            which become its targets
    free    what to vary: joints.NAME.kz,materials.NAME.young; of the rig head.ky, head.kz,
            head.kry, head.kt (kx and kz as one), foot.ky, ..., block.young, block.density
    out     the tuned scene (.toml)

    In Python `match` is [1, 3, 4] or {1: 51.2, 3: 905.0} as well, `free` a list, and `out` USUAL
    for NAME-tuned.toml. A file that beadwave did not write, or that was changed since, is replaced
    with `overwrite` alone. A mode missed by more than 5 % is a failure: `report.failures` lists
    them in sentences, and nothing is written. Raises InvalidScene for bad input.
    """
    from beadwave.workflows.structure.tuning import frequency_errors, tuned, write_scene

    chosen, wanted, remarks = with_modes(scene, changes, hammer, match, progress)

    # where to, before the fit: a file that cannot be written is refused at once
    path = file_name(f"{chosen.name}-tuned.toml") if out is USUAL else out
    inputs = files_read(chosen, scene, hammer)
    options = {"inputs": inputs, "ending": ".toml", "overwrite": overwrite}
    file = OutputFile(path, **options) if path else None

    result, report = tuned(chosen, wanted, names_of(free), progress)
    report = report.model_copy(update={"remarks": [*remarks, *report.remarks]})
    met = ", ".join(f"{n}: {hz:g} Hz" for n, hz in report.match.items())
    errors = frequency_errors(chosen, wanted).text()
    first = f"Joints inferred from modes {met}; deviations rest on {errors}."
    result, path = write_scene(result, None if report.failures else file, first, scene)
    return TuningResult(result, report, path)


@dataclass(frozen=True, repr=False)
class TunedToResponses:
    """The scene with fitted values, its report, the file it was written to, and `plot()`: measured
    responses under those computed before and after."""

    scene: Scene
    report: ResponseReport
    pictures: tuple[Picture, ...]
    file: Path | None

    def plot(self, name: str | None = None) -> Picture:
        """The picture "responses"."""
        return picture_named(self.pictures, name)

    def __repr__(self) -> str:
        return self.report.text()


def tune_to_responses(
    files: Iterable[str | Path] | str | Path,
    scene: Source = None,
    changes: Changes = (),
    *,
    free: str | Iterable[str] = (),
    points: str | Path | None = None,
    band: str | tuple[float, float] | None = None,
    match: str | Iterable[int] | None = None,
    out: str | Path | None = None,
    pictures: str | Path | None = None,
    overwrite: bool = False,
    progress: Progress = quiet,
) -> TunedToResponses:
    """Stiffness, mass and damping fitted to measured responses (`beadwave tune --frf`).

    The magnitude in dB and the phase of all responses are fitted, each line weighed by its noise,
    from values that meet the frequencies of the identified resonances. `files` and `points` as
    `hammer` takes them; places of hammer and sensors must be known. `free` names values of
    stiffness and mass as `tune` does, and of damping: damping.ratio, damping.alpha, damping.beta,
    damping.materials.NAME, damping.joints.NAME, joints.NAME.cz, springs.NAME.cz. `band` [Hz] and
    `match`, numbers of resonances from the lowest on, choose the lines that are read; others are
    predicted. `out` is the tuned scene, `pictures` a folder. Raises InvalidScene for bad input.
    """
    paths = _of_test(files)
    chosen = with_assembly(load_scene(scene, changes))
    band_hz, numbers = _band(band), None
    if match is not None:
        sentence = f"--match {match}: with --frf these are numbers of resonances, as 1,2,4."
        numbers = _whole_numbers(match, sentence)
    from beadwave.workflows.files.hammer import Reading
    from beadwave.workflows.structure.response_tuning import tuned_to_responses
    from beadwave.workflows.structure.tuning import write_scene

    reading = Reading(points=Path(points) if points else None)
    path = file_name(f"{chosen.name}-tuned.toml") if out is USUAL else out
    inputs = files_read(chosen, scene, *paths, reading.points)
    file = OutputFile(path, inputs=inputs, ending=".toml", overwrite=overwrite) if path else None
    folder = picture_folder(pictures, inputs, overwrite, "responses")
    result, report, drawn = tuned_to_responses(
        chosen, paths, names_of(free), progress, reading=reading, band_hz=band_hz, match=numbers
    )
    if folder:
        write_pictures(folder, drawn)
    first = f"Values inferred from the responses in {report.file}."
    result, path = write_scene(result, file, first, scene)
    return TunedToResponses(result, report, drawn, path)


@dataclass(frozen=True, repr=False)
class LossFactorFit:
    """The scene with fitted loss factors, the report, and the file it was written to, if any."""

    scene: Scene
    report: LossReport
    file: Path | None

    def __repr__(self) -> str:
        return self.report.text()


def fit_losses(
    scene: Source = None,
    changes: Changes = (),
    *,
    hammer: str | Path | None = None,
    out: str | Path | None = None,
    overwrite: bool = False,
    progress: Progress = quiet,
) -> LossFactorFit:
    """Loss factors of materials and joints from the damping ratios of measured modes, by whose
    strain energy each mode is (`beadwave tune --damping`).

    The ratios are `zeta` of the scene's targets, or those of a `hammer` test. To `out` goes the
    scene with damping.kind = "loss". Raises InvalidScene for bad input.
    """
    from beadwave.workflows.structure.losses import losses
    from beadwave.workflows.structure.tuning import write_scene

    chosen, _, remarks = with_modes(scene, changes, hammer, None, progress)
    inputs = files_read(chosen, scene, hammer)
    file = OutputFile(out, inputs=inputs, ending=".toml", overwrite=overwrite) if out else None
    result, report = losses(chosen, progress)
    report = report.model_copy(update={"remarks": [*remarks, *report.remarks]})
    first = "Loss factors inferred from the damping ratios of the targets."
    result, path = write_scene(result, file, first, scene)
    return LossFactorFit(result, report, path)


def rank_parameters(
    scene: Source = None,
    changes: Changes = (),
    *,
    hammer: str | Path | None = None,
    match: str | Iterable[int] | Mapping[int, float] | None = None,
    free: str | Iterable[str] = (),
    progress: Progress = quiet,
) -> RankReport:
    """Rank parameters before a fit to measured modes (`beadwave tune --rank`).

    Sensitivities d ln f / d ln value of each mode (and of the MAC of modes known by shape) to the
    values named in `free`, to all that can be freed without, at the values of the scene; the order
    in which they add most, and those that the modes determine together. Directions of joints that
    are rigid or open have the stiffness from which on they matter instead. `hammer` and `match` as
    `tune` takes them. Raises InvalidScene for bad input.
    """
    from beadwave.workflows.structure.ranking import ranked

    chosen, wanted, remarks = with_modes(scene, changes, hammer, match, progress)
    report = ranked(chosen, wanted, names_of(free), progress)
    return report.model_copy(update={"remarks": [*remarks, *report.remarks]})


def with_modes(
    scene: Source,
    changes: Changes,
    hammer: str | Path | None,
    match: str | Iterable[int] | Mapping[int, float] | None,
    progress: Progress,
) -> tuple[Scene, dict[int, float], list[str]]:
    """The scene, the modes {number: Hz} to meet, and remarks on them; raises InvalidScene."""
    if hammer:
        require_file(hammer, HAMMER)
    chosen = with_assembly(load_scene(scene, changes))
    from beadwave.workflows.stages.engine.pipeline import pipeline_of
    from beadwave.workflows.structure.tuning import numbered, targets

    # which modes: as `--match` takes them, "1,3,4" or "1=51.2,3=905"
    if isinstance(match, Mapping):
        match = ",".join(f"{n}={hz!r}" for n, hz in match.items())
    elif match is not None and not isinstance(match, str):
        match = ",".join(map(str, match))
    remarks: list[str] = []
    if chosen.measured_hz or not (match or hammer):
        measured = with_targets(chosen).measured_modes
        wanted = dict(measured) if match is None else targets(match, measured)
        if hammer:
            from beadwave.workflows.structure.hammer import hammer_test
            from beadwave.workflows.structure.pairing import applied, measured_shapes, recognised

            test = hammer_test(Path(hammer), wanted)
            if not isinstance(chosen, RigScene) and measured_shapes(test):
                test = recognised(test, pipeline_of(chosen, progress), wanted)
            chosen, wanted = applied(chosen, test.report, match)
            remarks = [step.text() for step in test.report.steps]
    elif hammer:
        from beadwave.workflows.structure.hammer import hammer_test
        from beadwave.workflows.structure.pairing import as_targets

        test = hammer_test(Path(hammer), {})
        chosen, wanted, remarks = as_targets(test, pipeline_of(chosen, progress), match)
        remarks += [step.text() for step in test.report.steps]
    else:
        chosen, wanted = numbered(chosen, match)
    return chosen, wanted, remarks


def names_of(free: str | Iterable[str]) -> tuple[str, ...]:
    """Names of the parameters that may vary; raises InvalidScene."""
    names = tuple(free.split(",")) if isinstance(free, str) else free
    if not isinstance(names, Iterable) or not all(isinstance(name, str) for name in names):
        raise InvalidScene(
            f'free = {free!r} must be names, as in ["joints.NAME.kz", "materials.NAME.young"].'
        )
    return tuple(name.strip() for name in names)


@dataclass(frozen=True, repr=False)
class HammerTest:
    """A hammer test: `report.rows` a mode each, `modes` with shapes, and pictures by `plot`."""

    report: HammerReport
    modes: IdentifiedModes
    pictures: tuple[Picture, ...]

    def plot(self, name: str | None = None) -> Picture:
        """A picture: "hammer" (the stability diagram), "synthesis", "coherence", "decay", "automac"
        or "mac" (with the modes of the model)."""
        return picture_named(self.pictures, name)

    def __repr__(self) -> str:
        return self.report.text()


def hammer(
    files: Iterable[str | Path] | str | Path,
    scene: Source = None,
    changes: Changes = (),
    *,
    points: str | Path | None = None,
    band: str | tuple[float, float] | None = None,
    estimator: str = "H1",
    window: float | None = None,
    force_channel: int = 1,
    reject: str | Iterable[int] = (),
    accept: str | Iterable[int] = (),
    out: str | Path | None = None,
    overwrite: bool = False,
    progress: Progress = quiet,
) -> HammerTest:
    """Modes of a structure from hits or measured responses, with deviations (`beadwave hammer`).

    files          of one test. Time records of hits: .csv with a header line time [s], force 12+z
                   [N], response 3+x [m/s^2], ...; .uff (data set 58), .mat, .wav. Or frequency
                   responses: .uff, .mat, or .csv with a header line, then frequency_hz, re_1, im_1,
                   re_2, im_2, ... on each line (Hz; receptance, mobility or accelerance in any
                   unit)
    scene          the scene with whose modes those of the test are paired; default: rig-rom
    points         points of the nodes: .csv (node, x, y, z in metres) or .uff
    band           frequencies to identify in [Hz], as 40:950
    estimator      H1, H2 or Hv
    window         what an exponential window leaves at a record's end, as 0.01
    force_channel  channel of the force in .wav files; 0: ring-downs
    reject         poles to leave out by their numbers, as 3,7
    accept         poles to take, though they were left out
    out            folder for modes.json, poles.html (the stability diagram, on which a click takes
                   a pole or leaves it out), modes.uff, where the points are known targets.toml, and
                   pictures: stability diagram, responses measured and of the modes, coherence,
                   AutoMAC, MAC with computed modes, measured and computed shapes

    The modes are paired with the measured modes of `scene` by frequency, or where the points of the
    test are known one-to-one with the modes of an assembly of bodies, by the MAC of their shapes
    and frequency together. Raises InvalidScene for bad input.
    """
    paths = _of_test(files)
    from beadwave.workflows.files.hammer import Reading, write_modes
    from beadwave.workflows.structure.hammer import Choice

    rejected, accepted = (
        _whole_numbers(numbers, f"{option} {numbers} must be numbers of poles, as 3,7.")
        for option, numbers in (("--reject", reject), ("--accept", accept))
    )
    if both := sorted({*rejected} & {*accepted}):
        raise InvalidScene(f"pole {both[0]} is in --accept and in --reject; name it in one alone.")
    choice = Choice(_band(band), rejected, accepted)
    reading = Reading(estimator, window, force_channel, Path(points) if points else None)
    reading.require()
    chosen = with_assembly(load_scene(scene, changes))
    inputs = files_read(chosen, scene, *paths, reading.points)
    folder = picture_folder(out, inputs, overwrite, *HAMMER_PICTURES)
    if folder:
        folder.require("modes.json", "poles.html", "modes.uff", "targets.toml")
    from beadwave.workflows.stages.engine.pipeline import pipeline_of
    from beadwave.workflows.structure.hammer import hammer_test, pictures
    from beadwave.workflows.structure.pairing import (
        mac_with_model,
        measured_shapes,
        recognised,
        shape_comparison,
        targets_of,
    )
    from beadwave.workflows.structure.pole_page import command_of, pole_page

    with progress("identification"):
        wanted = chosen.measured_modes
        test = hammer_test(paths, wanted, reading, choice)
    if scene is None and test.report.targets:
        test.report.remarks.append(
            f"modes are paired with those of {chosen.name}, as no --scene is given"
        )
    pipeline = None
    if not isinstance(chosen, RigScene) and measured_shapes(test):
        pipeline = pipeline_of(chosen, progress)
        test = recognised(test, pipeline, wanted)
    with progress("picture"):
        drawn = pictures(test)
        if pipeline:
            drawn += mac_with_model(test, pipeline)
        if folder and pipeline:
            try:
                drawn += shape_comparison(test, pipeline)
            except NoPicture as error:
                test.report.remarks.append(str(error))
        result = HammerTest(test.report, test.modes, tuple(drawn))
    if folder:
        made = [f"figures/{picture.name}.png" for picture in result.pictures]
        has_pyuff = find_spec("pyuff") is not None
        if not has_pyuff:
            without = "modes.uff and targets.toml are" if measured_shapes(test) else "modes.uff is"
            test.report.remarks.append(
                f"{without} not written, as universal files need pyuff; {adding('identify')} adds "
                "it, then repeat the command"
            )
        with folder.renewed("modes.json", *made) as renewed:
            renewed.write("modes.json", test.report.model_dump_json(indent=1) + "\n")
            command = command_of(paths, scene, changes, reading, choice, folder.path)
            structure = "" if scene is None else chosen.name
            renewed.write("poles.html", pole_page(test, choice, command, structure))
            write_pictures(renewed, result.pictures)
            if has_pyuff:
                with renewed.writing("modes.uff") as draft:
                    write_modes(
                        draft, test.test, test.modes.frequency_hz, test.modes.zeta, test.modes.phi
                    )
                if measured_shapes(test):
                    renewed.write("targets.toml", targets_of(test, folder.path / "modes.uff"))
    return result


def _of_test(files: str | Path | Iterable[str | Path]) -> list[Path]:
    """The files of a hammer test, one at least; raises InvalidScene for one that is not there."""
    paths = [files] if isinstance(files, str | Path) else list(files)
    if not paths:
        raise InvalidScene(f"no file; {HAMMER}.")
    return [require_file(file, HAMMER) for file in paths]


def _band(band: str | tuple[float, float] | None) -> tuple[float, float] | None:
    """Frequencies [Hz], as (40, 950) or "40:950"; raises InvalidScene for others."""
    if band is None:
        return None
    try:
        low, high = map(float, band.split(":") if isinstance(band, str) else band)
    except (TypeError, ValueError):
        low = high = np.nan
    if not 0 <= low < high < np.inf:
        raise InvalidScene(f"--band {band} must be FROM:TO in Hz, as 40:950.")
    return low, high


def _whole_numbers(numbers: str | Iterable[int], otherwise: str) -> tuple[int, ...]:
    """Whole numbers, as (3, 7) or "3,7"; raises InvalidScene with the sentence for others."""
    try:
        return tuple(map(int, numbers.split(",") if isinstance(numbers, str) else numbers))
    except (TypeError, ValueError):
        raise InvalidScene(otherwise) from None


def write_hammer_test(
    file: str | Path,
    scene: Source = None,
    changes: Changes = (),
    *,
    points: str | Path | None = None,
    band: str | tuple[float, float] | None = None,
    overwrite: bool = False,
    progress: Progress = quiet,
) -> Path:
    """A computed hammer test with noise, marked SYNTHETIC (`beadwave hammer --synthetic`).

    Responses to a .uff or .csv file, or with `points` time records of hits there to a .mat file, of
    the modes in `band` [Hz], the ten lowest without one. A file that beadwave did not write, or
    that was changed since, is only replaced with `overwrite`.
    """
    chosen = with_assembly(load_scene(scene, changes))
    from beadwave.workflows.files.hammer import (
        points_and_directions,
        synthetic_file,
        write_hits,
        write_synthetic,
    )
    from beadwave.workflows.stages.engine.pipeline import pipeline_of

    if points is None:
        synthetic = synthetic_file(Path(file), overwrite)
        from beadwave.workflows.structure.hammer import virtual_test

        write_synthetic(synthetic, virtual_test(pipeline_of(chosen, progress)))
        return synthetic.path
    inputs = files_read(chosen, scene, points)
    output = OutputFile(file, "FILE", inputs=inputs, ending=".mat", overwrite=overwrite)
    nodes, directions = points_and_directions(Path(points))
    from beadwave.workflows.structure.hammer_design import computed_hits

    hits = computed_hits(pipeline_of(chosen, progress), nodes, directions, _band(band))
    with output.writing() as draft:
        write_hits(draft, hits)
    return output.path


def design_hammer_test(
    file: str | Path,
    points: int,
    scene: Source = None,
    changes: Changes = (),
    *,
    band: str | tuple[float, float] | None = None,
    overwrite: bool = False,
    progress: Progress = quiet,
) -> HammerDesign:
    """Points to hit and to measure, so that the modes of a scene in `band` [Hz], the ten lowest
    without one, are told apart with this many points (`beadwave hammer --design`): written to a
    .csv that `hammer` takes as points. Raises InvalidScene for fewer points than modes."""
    chosen = with_assembly(load_scene(scene, changes))
    output = OutputFile(
        file, "FILE", inputs=files_read(chosen, scene), ending=".csv", overwrite=overwrite
    )
    from beadwave.workflows.stages.engine.pipeline import pipeline_of
    from beadwave.workflows.structure.hammer_design import designed

    design = designed(pipeline_of(chosen, progress), points, _band(band))
    with output.writing() as draft:
        draft.write_text(design.csv(), encoding="utf-8", newline="\n")
    return design


@dataclass(frozen=True, repr=False)
class ReductionResult:
    """A reduced model: `model` with K, M, C, w and the outer nodes' T; to a file by `save`."""

    scene: Scene
    model: ReducedModel
    pipeline: Pipeline

    def save(
        self, path: str | Path, matrices: str | Path | None = None, *, overwrite: bool = False
    ) -> list[Path]:
        """Write .npz, .mat or .h5, and to `matrices` (.mat, .npz) the full K, M and w."""
        files = output_files(
            {"--out": path, "--matrices": matrices},
            inputs=files_read(self.scene), overwrite=overwrite,
        )  # fmt: skip
        from beadwave.workflows.structure.export import write_reduced

        write_reduced(self.pipeline, *files.values())
        return [file.path for file in files.values()]

    @property
    def mesh(self) -> MeshNumbers | None:
        """The mesh that mesh.error led to; None where it is not asked for."""
        from beadwave.workflows.stages.engine.stage_table import has_sizes_chosen

        return self.pipeline("mesh-numbers") if has_sizes_chosen(self.scene) else None

    def plot(self) -> Picture:
        """The receptance at the contact, and solutions of the full model."""
        return self.pipeline("response").picture

    def __repr__(self) -> str:
        return f"{self.scene.name}: {self.model.kind}, {len(self.model.w)} coordinates"


def reduce(
    scene: Source = None,
    changes: Changes = (),
    *,
    out: str | Path | None = None,
    matrices: str | Path | None = None,
    overwrite: bool = False,
    progress: Progress = quiet,
) -> ReductionResult:
    """The assembly reduced to few coordinates at the contact (`beadwave reduce`).

    out       file of the reduced model: .npz, .mat or .h5
    matrices  write the full model's K, M, w as well (.mat, .npz)

    Files that beadwave did not write, or that were changed since, are only replaced with
    `overwrite`. Raises InvalidScene for bad input, ValueError where a computation fails.
    """
    chosen = with_structure(load_scene(scene, changes))
    files: Iterable[OutputFile] = ()
    if out:
        targets = {"--out": out, "--matrices": matrices}
        inputs = files_read(chosen, scene)
        files = output_files(targets, inputs=inputs, overwrite=overwrite).values()
    from beadwave.workflows.stages.engine.pipeline import pipeline_of
    from beadwave.workflows.structure.export import require_formats, write_reduced

    if files:
        require_formats(*files)
    pipeline = pipeline_of(chosen, progress)
    result = ReductionResult(chosen, pipeline("reduction"), pipeline)
    if files:
        write_reduced(pipeline, *files)
    return result


def reduce_matrices(
    K: ArrayLike | sparray,
    M: ArrayLike | sparray,
    w: ArrayLike,
    *,
    C: ArrayLike | sparray | None = None,
    modes: int | None = None,
    half_space: float = 0.0,
    young: float | None = None,
    poisson: float | None = None,
) -> ReducedModel:
    """K [N/m], M [kg], C [N s/m] (n, n) of one's own model, reduced for `beadwave.impact(rom=...)`.

    w (n,): u_w = w @ u is the displacement into the wall under the contact, averaged over the
    patch, sum(w) = 1 along the normal; the contact force enters as w F. `modes` free modes, 40
    without a number or all of a smaller model, and the residual vector K^-1 w, so that the static
    compliance is exact. half_space [m/N] is the compliance of the patch on a half-space that the
    mesh holds, and the Hertz law once more: 0.6 (1 - poisson^2) / (young b) of a Hertz-weighted
    disc of radius b on solid elements, 0 where w reads a point of a beam or shell. young [Pa] and
    poisson are of the surface struck, for the Hertz law; steel without them.

    Raises rom.ReductionError, a ValueError.
    """
    from beadwave import fem, rom

    n_modes = min(40, np.shape(w)[0]) if modes is None else modes
    selection = rom.Selection(n_modes=n_modes)
    reduced = rom.free_modes(K, M, w, selection, C=C, factorise=fem.factorised)
    return reduced._replace(contact=rom.Contact(half_space, young=young, poisson=poisson))
