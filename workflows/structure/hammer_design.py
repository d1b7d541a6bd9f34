"""Hammer tests before they are made: where to hit and watch, and records of computed hits."""

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel
from scipy.sparse import csr_matrix

from beadwave import fem
from beadwave.fem.identification.hit_records import degree_of_freedom
from beadwave.fem.identification.hits import Hits
from beadwave.fem.identification.measured_shapes import MeasuredShape
from beadwave.fem.identification.sensor_placement import effective_independence, outside
from beadwave.fem.identification.synthetic_hits import HammerDefects, HammerHits, struck
from beadwave.fem.modes.mac import strained
from beadwave.fem.modes.solver.full_responses import residual_flexibility
from beadwave.workflows.files.record import SYNTHETIC
from beadwave.workflows.report.tables import aligned_text
from beadwave.workflows.scene import InvalidScene
from beadwave.workflows.stages.engine.pipeline import Pipeline
from beadwave.workflows.stages.structure.loss_factors import ratios_of_modes
from beadwave.workflows.stages.structure.targets import placed

DEFECTS = HammerDefects(noise=0.01, double=0.05, overload=0.05, cross=0.01)


class PointRow(BaseModel):
    """A point to hit or watch, and along which axis."""

    node: int
    x: float  # [m], as the next
    y: float
    z: float
    direction: str


class HammerDesign(BaseModel):
    """Points of a test, and how well they tell the modes apart."""

    modes_hz: list[float]
    rows: list[PointRow]
    largest_mac: float  # of two modes at these points
    alike_hz: tuple[float, float]  # these two

    def text(self) -> str:
        """The points as a table, and the pair of modes that look most alike there."""
        cells = [(r.node, *(f"{v:.4f}" for v in (r.x, r.y, r.z)), r.direction) for r in self.rows]
        table = aligned_text(("node", "x [m]", "y [m]", "z [m]", "direction"), cells)
        listed = ", ".join(f"{hz:.5g}" for hz in self.modes_hz)
        return (
            f"{table}\n\nmodes: {listed} Hz\nmost alike at these points: "
            f"{self.alike_hz[0]:.5g} and {self.alike_hz[1]:.5g} Hz, MAC {self.largest_mac:.2f}"
        )

    def csv(self) -> str:
        """A file that `hammer --points` reads."""
        lines = [f"{r.node},{r.x:.9g},{r.y:.9g},{r.z:.9g},{r.direction}" for r in self.rows]
        return "\n".join(["node,x,y,z,direction", *lines]) + "\n"


def elastic(pipeline: Pipeline, band_hz: tuple[float, float] | None) -> NDArray[np.int64]:
    """Elastic modes (k,) in a band [Hz], the lowest ten without one; raises InvalidScene for
    none."""
    modes = pipeline("modes")
    hz = modes.omega / (2 * np.pi)
    elastic_modes = np.flatnonzero(strained(pipeline("model"), modes))
    if band_hz is None:
        # 10 elastic modes that are looked at without a band
        return elastic_modes[:10]
    chosen = elastic_modes[(hz[elastic_modes] >= band_hz[0]) & (hz[elastic_modes] <= band_hz[1])]
    if not len(chosen):
        raise InvalidScene(
            f"{pipeline.scene.name}: no mode between {band_hz[0]:g} and {band_hz[1]:g} Hz; those "
            f"known lie from {hz[elastic_modes[0]]:.5g} to {hz[-1]:.5g} Hz."
        )
    return chosen


def designed(pipeline: Pipeline, count: int, band_hz: tuple[float, float] | None) -> HammerDesign:
    """Points that tell the modes of a band [Hz] apart; raises InvalidScene where they cannot.

    `count` of the candidates on the outside by effective independence (D. C. Kammer, J. Guidance
    14 (1991) 251), and of the shapes on them the two that are most alike.
    """
    if pipeline.scene.test_axes:
        raise InvalidScene(
            f"{pipeline.scene.name}: points are planned in the axes of the assembly; drop "
            "[test_axes] for a design."
        )
    chosen, modes, model = elastic(pipeline, band_hz), pipeline("modes"), pipeline("model")
    try:
        candidates = outside(model)
        phi = (model.T[candidates.reading] @ modes.phi)[:, chosen]
        n_candidates, n_modes = phi.shape
        if count < n_modes <= n_candidates:
            raise ValueError(
                f"{count} points tell at most {count} modes apart, {n_modes} lie in the band; take "
                f"--design {n_modes} to {n_candidates}, or a narrower --band"
            )
        taken = effective_independence(phi, count)
    except ValueError as error:
        remedy = "take other points with --design, or a narrower --band"
        raise InvalidScene(f"{pipeline.scene.name}: {str(error).rstrip('.')}; {remedy}.") from None
    rows = [
        PointRow(
            node=n, x=point[0], y=point[1], z=point[2], direction="xyz"[candidates.axes[i]]
        )
        for n, (i, point) in enumerate(
            zip(taken.tolist(), candidates.points[taken].tolist(), strict=True), start=1
        )
    ]  # fmt: skip
    hz = modes.omega[chosen] / (2 * np.pi)
    alike = fem.mac(phi[taken], phi[taken]) - np.eye(len(chosen))
    i, j = np.unravel_index(int(alike.argmax()), alike.shape)
    return HammerDesign(
        modes_hz=hz.tolist(), rows=rows, largest_mac=float(max(alike[i, j], 0.0)),
        alike_hz=(float(hz[min(i, j)]), float(hz[max(i, j)])),
    )  # fmt: skip


def computed_hits(
    pipeline: Pipeline,
    nodes: dict[int, NDArray[np.float64]],
    directions: dict[int, int],
    band_hz: tuple[float, float] | None,
) -> Hits:
    """Records of hits at nodes along their directions, with noise, double hits and overloads.

    The hammer roves and hits each node three times; three sensors are at the nodes that tell the
    modes apart best. `nodes` are points (3,) [m] by their numbers, directions 1, 2, 3 of x, y, z
    with a sign, z where there is none. Raises InvalidScene without damping, for fewer than three
    points and for points off the assembly.
    """
    scene, model, modes = pipeline.scene, pipeline("model"), pipeline("modes")
    chosen = elastic(pipeline, band_hz)
    hz = modes.omega[chosen] / (2 * np.pi)
    ratios = ratios_of_modes(scene, model, modes)
    zeta = ratios[chosen]
    if not (zeta > 0).all():
        raise InvalidScene("computed hits need damping; set damping.kind=modal with a ratio.")
    n_sensors = 3
    if len(nodes) < n_sensors:
        raise InvalidScene(f"{len(nodes)} points; computed hits need {n_sensors} or more.")

    # the shape at each node along its direction
    numbers = sorted(nodes)
    axes = np.array([directions.get(node, 3) for node in numbers])
    along = np.sign(axes)[:, None] * np.eye(3)[np.abs(axes) - 1]
    spots = MeasuredShape(np.array([nodes[n] for n in numbers]), along, np.ones(len(axes), complex))
    reading = placed(scene, model, "--points", spots, float(hz[0])).reading
    phi = np.asarray(reading @ modes.phi)[:, chosen]
    few = min(n_sensors, len(chosen))
    watched = effective_independence(phi[:, :few], n_sensors)
    names = tuple(degree_of_freedom(n, int(axis)) for n, axis in zip(numbers, axes, strict=True))

    # what else moves: modes outside of the band, rigid motions, and what all higher modes yield, as
    # modes at 1000 times the band, of which nothing but the flexibility is seen
    others = np.setdiff1d(np.arange(len(modes.omega)), chosen)
    size, axes_of = np.linalg.eigh(residual_flexibility(model, modes, csr_matrix(reading)))
    high = np.full(len(size), 1e3 * hz[-1])
    yielding = axes_of * np.sqrt(size.clip(0.0)) * 2 * np.pi * high
    beyond = (
        np.concatenate([modes.omega[others] / (2 * np.pi), high]),
        np.concatenate([ratios[others], np.ones(len(high))]),
        np.hstack([np.asarray(reading @ modes.phi)[:, others], yielding]),
    )
    return hits_of_modes((hz, zeta), phi, watched, names, beyond=beyond)


def hits_of_modes(
    poles: tuple[NDArray[np.float64], NDArray[np.float64]],
    phi: NDArray[np.float64],
    watched: NDArray[np.int64],
    names: tuple[str, ...],
    *,
    beyond: tuple[NDArray[np.float64], ...] | None = None,
    seed: int = 0,
    defects: HammerDefects = DEFECTS,
    longest: int = 2**16,
) -> Hits:
    """Records of three hits at each of p points of a structure with frequencies [Hz] and damping
    ratios (n,) and mass-normalised shapes phi (p, n) there, sensors at the points `watched`.

    `beyond` are frequencies, ratios and shapes of what else moves, as modes outside of the band.
    Pulses reach to the highest mode, records last until the lowest has fallen to a thousandth, of
    `longest` samples at most.
    """
    hz, zeta = poles
    dt = 1 / (2.56 * 1.2 * hz[-1])
    seconds = 0.05 + np.log(1e3) / float(np.min(2 * np.pi * hz * zeta))
    k = int(min(seconds / dt, longest))
    rng = np.random.default_rng(seed)
    plan = HammerHits(len(names), 3, dt, k, 1.0 / hz[-1])
    if beyond is not None:
        hz, zeta, phi = (
            np.concatenate(pair, axis=-1) for pair in zip((hz, zeta, phi), beyond, strict=True)
        )
    shapes = phi, phi[::-1], phi[watched]  # a side hit moves what another point moves
    force, response, point, _ = struck(rng, (hz, zeta), shapes, defects, plan)
    return Hits(
        dt,
        force,
        response,
        point,
        names,
        tuple(names[i] for i in watched),
        SYNTHETIC,
        "accelerations",
    )
