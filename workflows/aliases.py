"""Former import paths and class names, and the packages as `beadwave.fem`, `beadwave.dem`, ...

    from coupling.inspection.inversion import inverted    # a former path: warns with the new one
    dem.Search                                            # a former class name: likewise
    import beadwave.dem                                   # the package `dem`

`import beadwave` and `import workflows` install the finder. A module has one object under all of
its names, so that classes and compiled functions are never there twice.
"""

import sys
from importlib import import_module
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder, SourceFileLoader
from warnings import warn

ROOMS = ("geometry", "fem", "rom", "dem", "coupling", "workflows")

# modules whose own name changed; CHANGELOG has the same map for readers
MOVED_MODULES = {
    "coupling.collision": "workflows.evidence.thesis.collision",
    "coupling.edge_series": "workflows.evidence.thesis.boundary_distance",
    "coupling.energy_run": "workflows.evidence.thesis.schemes",
    "coupling.exudyn_scene": "workflows.evidence.verify.exudyn",
    "coupling.formulas": "workflows.evidence.verify.formulas",
    "coupling.lammps_chain": "workflows.evidence.verify.lammps",
    "coupling.observed_run": "workflows.evidence.thesis.observed_run",
    "coupling.parametric_wall": "workflows.fit.parametric_wall",
    "coupling.peers": "workflows.evidence.accuracy.peers",
    "coupling.plate_sizes": "workflows.evidence.thesis.plates",
    "coupling.records.formats": "workflows.files.record_formats",
    "coupling.records.record": "workflows.files.record",
    "coupling.sensed_waves": "coupling.sensors",
    "coupling.sensor_record": "coupling.sensors",
    "coupling.verification.comparisons": "workflows.evidence.harness",
    "coupling.verification.exact": "workflows.evidence.verify.exact_reductions",
    "coupling.verification.formulas": "workflows.evidence.verify.random_scenes",
    "coupling.verification.honesty": "workflows.evidence.verify.honest_errors",
    "coupling.verification.outcomes": "workflows.evidence.harness",
    "coupling.wall": "coupling.reduced_wall",
    "coupling.wave_distance": "workflows.evidence.thesis.wave_distance",
    "coupling.work_precision.parts": "workflows.evidence.accuracy.parts",
    "coupling.work_precision.problems": "workflows.evidence.accuracy.problems",
    "coupling.work_precision.rows": "workflows.evidence.accuracy.row",
    "coupling.work_precision.sizes": "workflows.evidence.accuracy.chain_length",
    "coupling.work_precision.orders": "workflows.evidence.accuracy.time",
    "coupling.work_precision.population": "workflows.evidence.accuracy.batch",
    "fem.identification": "fem.half_power",
    "geometry.bodies": "geometry.naming",
    "geometry.foreseen": "geometry.body_mesh",
    "geometry.prism": "geometry.hexahedra",
    "geometry.quads": "geometry.hexahedra",
    "geometry.tetrahedra": "geometry.body_mesh",
    "rom.cbcheck": "workflows.evidence.verify.pyyeti",
    "workflows.api.doctor": "workflows.installation.doctor",
    "workflows.api.film": "workflows.run.api",
    "workflows.api.folders": "workflows.files.picture_folder",
    "workflows.api.hammer": "workflows.structure.api",
    "workflows.api.impacts": "workflows.run.api",
    "workflows.api.inspection": "workflows.fit.api",
    "workflows.api.look": "workflows.structure.api",
    "workflows.api.measurements": "workflows.fit.api",
    "workflows.api.modes": "workflows.structure.api",
    "workflows.api.progress": "workflows.stages.progress",
    "workflows.api.reduction": "workflows.structure.api",
    "workflows.api.scenes": "workflows.run.api",
    "workflows.api.studies": "workflows.evidence.api",
    "workflows.api.sweeps": "workflows.sweep.api",
    "workflows.api.tuning": "workflows.structure.api",
    "workflows.calibration.channels": "workflows.fit.calibrate",
    "workflows.files.records": "workflows.fit.record",
    "workflows.files.velocities": "workflows.fit.record",
    "workflows.files.wall": "workflows.files.wall_file",
    "workflows.fit.calibration.parameters": "workflows.fit.scene_parameters",
    "workflows.fit.core.calibration.calibration": "workflows.fit.chain_fit",
    "workflows.fit.core.calibration.coverage": "workflows.fit.instrument",
    "workflows.fit.core.calibration.fitting": "workflows.fit.least_squares",
    "workflows.fit.core.calibration.growing_windows": "workflows.fit.windows",
    "workflows.fit.core.calibration.impulse": "workflows.fit.scaling",
    "workflows.fit.core.calibration.parameters": "workflows.fit.parameter",
    "workflows.fit.core.calibration.scan": "workflows.fit.windows",
    "workflows.fit.core.calibration.search": "workflows.fit.windows",
    "workflows.fit.core.inspection.answer": "workflows.fit.inspect",
    "workflows.fit.core.inspection.fitting": "workflows.fit.least_squares",
    "workflows.fit.core.inspection.foreseen": "workflows.fit.design",
    "workflows.fit.core.inspection.information": "workflows.fit.uncertainty",
    "workflows.fit.core.inspection.model_errors": "workflows.fit.inversion",
    "workflows.fit.core.inspection.profile": "workflows.fit.uncertainty",
    "workflows.fit.core.inspection.reading": "workflows.fit.plausibility",
    "workflows.fit.core.inspection.search": "workflows.fit.candidates",
    "workflows.fit.inspection.numbers": "workflows.fit.scene_parameters",
    "workflows.fit.records": "workflows.fit.record",
    "workflows.fit.velocities": "workflows.fit.record",
    "workflows.pipeline.run": "workflows.run.run",
    "workflows.pipeline.second_process": "workflows.run.second_process",
    "workflows.pipeline.wall": "workflows.stages.walls",
    "workflows.scene.tables": "workflows.scene",
    "workflows.stages.wall": "workflows.stages.walls",
    "workflows.studies.accuracy.reduction_picture": "workflows.evidence.accuracy.reduction",
    "workflows.studies.accuracy.rows": "workflows.evidence.accuracy.row",
    "workflows.studies.finding": "workflows.report.finding",
    "workflows.studies.thesis.rig_statements": "workflows.evidence.thesis.rig",
    "workflows.studies.thesis.thickness_figure": "workflows.evidence.thesis.wall_thickness",
    "workflows.studies.verify.comparisons": "workflows.evidence.harness",
    "workflows.studies.verify.exact": "workflows.evidence.verify.exact_structures",
    "workflows.studies.verify.honesty": "workflows.evidence.verify.honest_errors",
    "workflows.sweep.effects": "workflows.sweep.result",
}
# packages whose modules kept their names
MOVED_PACKAGES = {
    "coupling.calibration": "workflows.fit.core.calibration",
    "coupling.inspection": "workflows.fit.core.inspection",
    "coupling.stability": "workflows.evidence.stability",
    "coupling.sweep": "workflows.sweep.core",
    "coupling.verification": "workflows.evidence.verify",
    "coupling.work_precision": "workflows.evidence.accuracy",
    "workflows.assembly": "workflows.structure",
    "workflows.calibration": "workflows.fit.calibration",
    "workflows.fit.calibration": "workflows.fit",
    "workflows.fit.core": "workflows.fit",
    "workflows.fit.core.calibration": "workflows.fit",
    "workflows.fit.core.inspection": "workflows.fit",
    "workflows.fit.inspection": "workflows.fit",
    "workflows.inspection": "workflows.fit.inspection",
    "workflows.pipeline": "workflows.stages",
    "workflows.results": "workflows.report",
    "workflows.studies": "workflows.evidence",
    "workflows.studies.accuracy": "workflows.evidence.accuracy",
    "workflows.studies.stability": "workflows.evidence.stability",
    "workflows.studies.thesis": "workflows.evidence.thesis",
    "workflows.studies.verify": "workflows.evidence.verify",
}
# classes whose name stood for something else as well, by package
RENAMED_CLASSES = {
    "dem": {"Search": "StepSearch"},
    "fem": {"End": "BeamEnd", "Motion": "BodyMotion", "Table": "SwayingTable"},
    "rom": {"Factor": "Solver"},
}


def present_path(name: str) -> str | None:
    """The path of today of a module that moved, or None.

    >>> present_path("coupling.sweep.design")
    'workflows.sweep.core.design'
    >>> present_path("coupling.calibration.fitting")
    'workflows.fit.least_squares'
    """
    path = MOVED_MODULES.get(name)
    if path is None:
        holding = [package for package in MOVED_PACKAGES if f"{name}.".startswith(f"{package}.")]
        package = max(holding, key=len, default="")
        path = MOVED_PACKAGES[package] + name[len(package) :] if package else None

    # a module may have moved more than once
    return path and (present_path(path) or path)


def with_former_names(room) -> None:
    """Give a package the former names of its classes, each with a DeprecationWarning."""

    def __getattr__(name: str):  # noqa: N807  asked by Python for what a module lacks (PEP 562)
        present = RENAMED_CLASSES[room.__name__].get(name)
        if present is None:
            raise AttributeError(f"module {room.__name__!r} has no attribute {name!r}")
        warn(
            f"{room.__name__}.{name} is {room.__name__}.{present} now.",
            DeprecationWarning,
            stacklevel=2,
        )
        return getattr(room, present)

    room.__getattr__ = __getattr__


class RoomLoader(SourceFileLoader):
    """Loads a package and gives it the former names of its classes."""

    def exec_module(self, module):
        """Run the package's code, then add the names."""
        super().exec_module(module)
        with_former_names(module)


class AliasFinder(MetaPathFinder, Loader):
    """Finds a module by a former path, as `beadwave.ROOM`, or a package with former class names."""

    def find_spec(self, fullname, path=None, target=None):
        """The spec of an alias; None leaves the name to the other finders."""
        if fullname in RENAMED_CLASSES:
            spec = PathFinder.find_spec(fullname, path)
            # a user's dem.py that stands in the way of the package is none of ours
            is_package = spec is not None and spec.submodule_search_locations is not None
            if is_package and type(spec.loader) is SourceFileLoader:
                spec.loader = RoomLoader(fullname, spec.origin)
            return spec
        room = fullname.removeprefix("beadwave.")
        if room != fullname and room.split(".")[0] in ROOMS:
            return ModuleSpec(fullname, self, origin=room, is_package=True)
        path_today = present_path(fullname)
        if path_today is None:
            return None
        warn(f"{fullname} is {path_today} now.", DeprecationWarning, stacklevel=2)
        return ModuleSpec(fullname, self, origin=path_today, is_package=True)

    def create_module(self, spec):
        """The module itself; the import system would put the alias's spec onto it."""
        module = import_module(spec.origin)
        spec.loader_state = module.__spec__
        return module

    def exec_module(self, module):
        """Give back the module's own spec: it was executed under its own name."""
        module.__spec__ = module.__spec__.loader_state


def install() -> None:
    """Put the finder before all others: the path of a moved package holds modules of that name."""
    if not any(isinstance(finder, AliasFinder) for finder in sys.meta_path):
        sys.meta_path.insert(0, AliasFinder())
        for name in RENAMED_CLASSES.keys() & sys.modules.keys():
            with_former_names(sys.modules[name])
