"""Does a hammer test give joints, frequencies and damping of every built-in assembly back?

You will see, for each assembly, virtual hammer tests drawn by a seed: its joints are scattered by
30 %, three sensors of 2 g weigh on it (and on the model), it is hit three times at each of fifteen
points, and records have noise of 2 % of each channel, double hits, overloads, hits off their
direction. They go through responses, poles and pairing by shape to a fit of all joints that give
way, as `hammer` and `tune` do it:

    joints -> modes of the full model -> hits with noise -> modes -> joints

A line counts the lowest modes that were found (frequency within 0.05 %, damping within 5 %, MAC
0.9), poles that are none, the largest errors of these modes, and stiffnesses within two of their
own deviations, where 95 of 100 belong, with the largest error and the rms of error over deviation.
`open` are stiffnesses that the modes do not determine: they keep the value that the scene has.

Run it: python examples/round_trip.py [joints] [tests] [first seed] [assembly]
        10 sets of joints, 2 tests of each, on a coarse mesh: two minutes an assembly with joints
"""

import sys
from contextlib import nullcontext
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from beadwave.coupling import damping_ratios
from beadwave.fem.contact.impact_point import plane_spot
from beadwave.fem.identification.hits import frequency_responses
from beadwave.fem.identification.measured_shapes import MeasuredShape
from beadwave.fem.identification.poly_reference import identified_modes
from beadwave.fem.identification.sensor_placement import effective_independence, outside
from beadwave.fem.identification.synthetic_hits import HammerDefects
from beadwave.fem.modes.mac import Shape, mac, measured_pairs, strained
from beadwave.fem.updating.tuning import determined, deviation_of_others, tune, tuning_basis
from beadwave.workflows.files.scene import scene
from beadwave.workflows.scene import Scene
from beadwave.workflows.scene.places import mass_face
from beadwave.workflows.stages.engine.pipeline import Pipeline, pipeline_of
from beadwave.workflows.stages.structure.loss_factors import structure_damping
from beadwave.workflows.stages.structure.targets import placed
from beadwave.workflows.structure.hammer_design import hits_of_modes
from beadwave.workflows.structure.parameters import at_values, freed
from beadwave.workflows.structure.tuning import loosened

POINTS, SCATTER, COARSER = 12, 0.3, 2.0
DEFECTS = HammerDefects(noise=0.02, double=0.05, overload=0.05, cross=0.01)
LONGEST = 2**14  # samples of a record
LEAST = 1e-4  # relative error of a frequency, below which `tune` takes none
ON_RIG = (("block:+z", (0.04, 0.03)), ("block:+y", (-0.04, 0.01)), ("sheet+y:+y", (0.0, -0.02)))
# sensors [face, place on it, m], and how many of the lowest modes are looked at
TESTS = {
    "rig-rom": (ON_RIG, 6),
    "rig-rom-269": (ON_RIG, 6),
    "rig-rom-907": (ON_RIG, 6),
    "rig-shaker": (ON_RIG, 6),
    "rig-full-tie": (ON_RIG, 6),
    "plate-on-bolts": (
        (("cover:+z", (0.065, 0.02)), ("cover:+z", (-0.03, 0.01)), ("cover:+z", (0.02, -0.03))), 8,
    ),
    "cantilever": (
        (("beam:+y", (0.13, 0.0)), ("beam:+z", (0.12, 0.0)), ("beam:+z", (-0.02, 0.0))), 6,
    ),
}  # fmt: skip


class Counts(NamedTuple):
    """Numbers of modes and joints of some tests that were found, missed or wrong."""

    modes: int = 0
    found: int = 0  # frequency within 0.05 %, damping within 5 %, MAC 0.9
    false: int = 0
    values: int = 0  # fitted stiffnesses
    within: int = 0  # two of their deviations
    open: int = 0  # stiffnesses that the modes do not determine
    worst_hz: float = 0.0  # relative, of the modes
    worst_zeta: float = 0.0
    worst: float = 0.0  # relative, of the fitted values
    square: float = 0.0  # sum of (error / deviation)^2

    @property
    def line(self) -> str:
        """Cells of the table."""
        modes = f"{self.found:5} of {self.modes:4} {self.false:6}"
        errors = f"{1e6 * self.worst_hz:8.2g} ppm {100 * self.worst_zeta:8.2g} %"
        if not self.values + self.open:
            return f"{modes} {errors}   no joint"
        rms = np.sqrt(self.square / max(self.values, 1))
        within = f"{self.within:5} of {self.values:4} {100 * self.worst:7.2g} % {rms:6.2f}"
        return f"{modes} {errors} {within} {self.open:6}"

    def __add__(self, other: "Counts") -> "Counts":
        worst = {"worst_hz", "worst_zeta", "worst"}
        pairs = zip(self._fields, self, other, strict=True)
        return Counts(*(max(a, b) if name in worst else a + b for name, a, b in pairs))


class Test(NamedTuple):
    """A structure with sensors on it, where it is hit and watched, and what is fitted."""

    scene: Scene
    run: Pipeline
    free: tuple[str, ...]
    points: MeasuredShape
    watched: NDArray[np.int64]  # those points that have sensors
    n_modes: int


def planned(name: str) -> Test:
    """The scene of this name with three sensors of a few grams, and fifteen points to hit."""
    # sensors weigh on the structure that is tested as on the model
    sensors, n_modes = TESTS[name]
    masses = [
        {"name": f"sensor-{i}", "on": on, "at": list(at), "mass": 2e-3, "radius": 4e-3}
        for i, (on, at) in enumerate(sensors)
    ]
    watching = scene(name, {"mesh.scale": COARSER, "masses": masses})
    free = tuple(
        f"{joint}.{key}"
        for joint, table in watching.bushings.items()
        for key in ("kx", "ky", "kz", "krx", "kry", "krz")
        if 0 < getattr(table, key) < np.inf
    )
    run = pipeline_of(watching, lambda stage: nullcontext())

    # where the sensors are, and the points that tell the lowest modes apart
    model, modes, parts = run("model"), run("modes"), run("mesh")
    spots = []
    for mass, (_, at) in zip(masses, sensors, strict=True):
        face = parts.face(mass_face(mass["name"]))
        mesh = parts.meshes[face.partition(":")[0]]
        spots.append(plane_spot(mesh, parts.facets(face), face, at))
    candidates = outside(model)
    lowest = np.flatnonzero(strained(model, modes))[:n_modes]
    hit = effective_independence((model.T[candidates.reading] @ modes.phi)[:, lowest], POINTS)
    places = np.vstack([[spot.point for spot in spots], candidates.points[hit]])
    along = np.vstack([[-spot.inward for spot in spots], np.eye(3)[candidates.axes[hit]]])
    shape = MeasuredShape(places, along, np.ones(len(places), complex))
    return Test(watching, run, free, shape, np.arange(len(sensors)), n_modes)


def round_trips(test: Test, joints: int, tests: int, first: int) -> Counts:
    """Tests of structures whose joints are drawn by seeds from `first` on."""
    candidates = freed(test.scene, test.free) if test.free else []
    nominal, nominal_model = test.run("modes"), test.run("model")
    at_points = placed(test.scene, nominal_model, "points", test.points, 0.0)
    if candidates:
        loose = pipeline_of(loosened(test.scene, candidates), lambda stage: nullcontext())
        basis = tuning_basis(loose("model"), (at_points,))
    counts = Counts()
    for seed in range(first, first + (joints if candidates else 1)):
        # a structure with other joints, and its true modes at the points of the test
        rng = np.random.default_rng(seed)
        scatter = np.exp(SCATTER * rng.standard_normal(len(candidates)))
        true_value = np.array([p.before[0] for p in candidates]) * scatter
        truth = at_values(test.scene, candidates, true_value) if candidates else test.scene
        run = pipeline_of(truth, lambda stage: nullcontext())
        model, modes = run("model"), run("modes")
        lowest = np.flatnonzero(strained(model, modes))[: test.n_modes]
        hz = modes.omega[lowest] / (2 * np.pi)
        zeta = damping_ratios(structure_damping(truth, model, modes), modes.omega)[lowest]
        phi = np.asarray(at_points.reading @ modes.phi)[:, lowest]

        # hits with noise and mishaps, their responses, the poles of these
        for draw in range(tests):
            names = tuple(f"point {i + 1}" for i in range(len(phi)))
            hits = hits_of_modes(
                (hz, zeta), phi, test.watched, names,
                seed=100 * seed + draw, defects=DEFECTS, longest=LONGEST,
            )  # fmt: skip
            responses = frequency_responses(hits)
            identified = identified_modes(responses, (0.5 * hz[0], 1.05 * hz[-1]))
            rows = [names.index(point) for point in responses.points]

            # which are modes of the truth
            likeness = mac(identified.phi, phi[rows])
            off_hz = np.abs(identified.frequency_hz[:, None] / hz - 1)
            off_zeta = np.abs(identified.zeta[:, None] / zeta - 1)
            same = (off_hz < 5e-3) & (likeness > 0.9)
            good = same & (off_hz < 5e-4) & (off_zeta < 0.05)
            counts += Counts(
                modes=len(hz),
                found=int(good.any(axis=0).sum()),
                false=int(np.count_nonzero(~same.any(axis=1))),
                worst_hz=float(off_hz[same].max(initial=0.0)),
                worst_zeta=float(off_zeta[same].max(initial=0.0)),
            )
            if not candidates:
                continue

            # paired with the model as it was before the test, doubtful ones left out
            reading = at_points.reading @ nominal.phi
            computed_hz = nominal.omega / (2 * np.pi)
            pairs = measured_pairs(
                identified.frequency_hz, computed_hz,
                mac(identified.phi, reading[rows]), mac(reading[rows], reading[rows]),
            )  # fmt: skip
            sure = [
                i
                for i, j in enumerate(pairs.index)
                if j >= 0 and not any("doubtful" in sentence for sentence in pairs.doubts[i])
            ]

            # a fit to these modes, then of the stiffnesses alone that they determine; bars hold
            # what is left open, and what the modes are missed by
            in_basis = basis.targets[0].reading[rows]
            targets = tuple(
                Shape(in_basis, identified.phi[:, i], identified.frequency_hz[i]) for i in sure
            )
            measured = {n: float(identified.frequency_hz[i]) for n, i in enumerate(sure, start=1)}
            deviation = identified.frequency_deviation[sure] / identified.frequency_hz[sure]
            errors = {n: max(float(s), LEAST) for n, s in enumerate(deviation, start=1)}
            aimed = basis._replace(targets=targets)
            fit = tune(aimed, candidates, measured, frequency_error=errors)
            of_all = determined(aimed, candidates, measured, fit, frequency_error=errors)
            if len(of_all) < len(candidates):
                fit = tune(aimed, of_all, measured, frequency_error=errors)
            left_out = [p for p in candidates if p not in of_all]
            bars = deviation_of_others(aimed, fit, measured, left_out, frequency_error=errors)
            true = np.array([x for p, x in zip(candidates, true_value, strict=True) if p in of_all])
            spare = len(measured) - len(of_all)
            scatter = max(1.0, np.sqrt(fit.misfit / spare)) if spare > 0 else 1.0
            z = np.log(fit.value / true) / (bars * scatter)
            counts += Counts(
                values=len(true),
                within=int(np.count_nonzero(np.abs(z) < 2)),
                open=len(candidates) - len(true),
                worst=float(np.abs(fit.value / true - 1).max(initial=0.0)),
                square=float(z @ z),
            )
    return counts


def main(joints: int = 10, tests: int = 2, first: int = 0, only: str = "") -> dict[str, Counts]:
    """Print the table; the counts of each assembly, and of all together under ""."""
    print(
        f"{'':16} {'modes found':>13} {'false':>6} {'worst: Hz':>12} {'damping':>10} "
        f"{'joints held':>13} {'worst':>9} {'rms':>6} {'open':>6}"
    )
    table: dict[str, Counts] = {}
    for name in TESTS:
        if only in name:
            table[name] = round_trips(planned(name), joints, tests, first)
            print(f"{name:16} {table[name].line}", flush=True)
    table[""] = sum(table.values(), Counts())
    print(f"{'together':16} {table[''].line}")
    return table


if __name__ == "__main__":
    main(*(kind(text) for kind, text in zip((int, int, int, str), sys.argv[1:], strict=False)))
