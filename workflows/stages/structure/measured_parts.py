"""Parts known by their receptances, joined to the assembly: where their points are on it."""

from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from beadwave import fem, rom
from beadwave.fem.assembly.trace import OffFace
from beadwave.rom.passive_fit import refitted
from beadwave.workflows.files.part_receptances import AXES, PartReceptances, receptances
from beadwave.workflows.scene import InvalidScene, Scene
from beadwave.workflows.scene.places import part_face
from beadwave.workflows.scene.tables.measured import MeasuredTable
from beadwave.workflows.stages.engine.cache import key, memory
from beadwave.workflows.stages.structure.meshed_parts import Parts
from beadwave.workflows.stages.structure.targets import axes_of_test

# [m] of a measured point from the plane of its face, over the disc's radius, beyond which axes or
# units are taken to be wrong; chosen, not varied
FARTHEST = 2.0


# Error of a fit
N_DRAWS = 3  # fits of the responses with their residuals at random phases
BAND_SHARE = 0.8  # of the highest frequency, up to which another fit reads
MAX_MISSED = 0.3  # of the receptances missed (rms), above which modes are no model of the part


class FittedPart(NamedTuple):
    """The fit of a part's receptances and others that differ by its errors."""

    receptances: PartReceptances
    fit: rom.ModalFit
    by_noise: tuple[rom.ModalFit, ...]  # of the fit plus its residuals at random phases
    by_band: rom.ModalFit  # of the lower part of the band

    @property
    def synthetic(self) -> bool:
        """True if the file says that its responses were computed."""
        return self.receptances.synthetic


def fitted_part(table: MeasuredTable) -> FittedPart:
    """The fit of a part's responses, made again only where file or keys have changed; raises
    InvalidScene for a file that has them not."""
    status = Path(table.receptance).stat() if Path(table.receptance).is_file() else None
    stamp = status and (status.st_mtime_ns, status.st_size, status.st_ino)
    read = ("name", "receptance", "unit", "points", "directions", "held", "lowest", "highest")
    return _fitted(tuple((k, getattr(table, k)) for k in read), stamp)


@lru_cache(maxsize=8)
def _fitted(keys: tuple, stamp: tuple[int, int, int] | None) -> FittedPart:
    """`fitted_part` of a table with these keys, and of a file with this stamp; fits are kept on
    disk by the content of the responses, as they take seconds."""
    table = MeasuredTable.model_construct(**dict(keys))
    part = receptances(table)
    contents = [part.frequency_hz.tolist(), part.H.view(float).ravel().tolist(), table.held]
    store = memory()
    fits = fits_of if store is None else store.cache(fits_of, ignore=["part"])
    try:
        fit, by_noise, by_band = fits(key("measured", contents, []), part, table.held)
    except rom.ReductionError as error:
        raise InvalidScene(
            f"measured.{table.name}: {table.receptance}: {str(error).rstrip('.')}."
        ) from None
    return FittedPart(part, fit, by_noise, by_band)


def fits_of(
    content: str, part: PartReceptances, held: bool
) -> tuple[rom.ModalFit, tuple[rom.ModalFit, ...], rom.ModalFit]:
    """The fit of receptances, those of its residuals at random phases, and that of the lower part
    of the band, without free masses where the part is held; raises ReductionError. `content` names
    them in the cache."""
    f, H = part.frequency_hz, part.H
    fit = rom.passive_fit(f, H, most_free=0 if held else rigid_motions(part))
    if fit.error > MAX_MISSED:
        raise rom.ReductionError(
            f"modes miss {fit.error:.0%} of its receptances (rms), allowed are {MAX_MISSED:.0%}: "
            "check names and signs of the points"
            + (", or that it is held" if held else "")
            + ", or leave out frequencies by lowest and highest"
        )
    model, rng = rom.modal_receptance(fit, f), np.random.default_rng(0)
    by_noise = []
    for _ in range(N_DRAWS):
        phase = np.exp(2j * np.pi * rng.random(H.shape))
        phase = np.triu(phase) + np.triu(phase, 1).swapaxes(1, 2)
        by_noise.append(refitted(f, model + (H - model) * phase, fit))
    inside = f <= BAND_SHARE * f[-1]
    return fit, tuple(by_noise), refitted(f[inside], H[inside], fit)


def with_parts(
    scene: Scene,
    mesh: Parts,
    structure: fem.Structure,
    fits: dict[str, rom.ModalFit] | None = None,
) -> fem.Structure:
    """The structure joined to the scene's measured parts, with their fits or others by their names;
    raises InvalidScene for points that are not on the face."""
    for table in scene.measured or ():
        face, part = mesh.face(part_face(table.name)), fitted_part(table)
        fit = (fits or {}).get(table.name, part.fit)
        key = f"{scene.name}: measured.{table.name}"
        try:
            points = points_on_face(scene, table, face, structure, part)
            joined = measured_part(table, fit, points)
            structure = fem.with_measured(structure, [joined])
        except (OffFace, ValueError) as error:
            why = str(error).replace(face, table.on).rstrip(".")
            raise InvalidScene(f"{key}: {why}.") from None
    return structure


def measured_part(
    table: MeasuredTable, fit: rom.ModalFit, points: tuple[fem.PartPoint, ...]
) -> fem.MeasuredPart:
    """A fit as a part with its points; free masses are oscillators of no stiffness."""
    n_free = fit.free.shape[1]
    return fem.MeasuredPart(
        table.name, np.append(fit.omega, np.zeros(n_free)), np.append(fit.zeta, np.zeros(n_free)),
        np.hstack([fit.phi, fit.free]), fit.compliance, points, table.stiffness,
    )  # fmt: skip


def points_on_face(
    scene: Scene, table: MeasuredTable, face: str, structure: fem.Structure, part: FittedPart
) -> tuple[fem.PartPoint, ...]:
    """Place and direction of each motion of a part on its face; raises ValueError for nodes without
    a place, and for places off the face."""
    middle = fem.planar_spot(structure, face, (0.0, 0.0))
    measured, axes = part.receptances, axes_of_test(scene)
    turn = np.eye(3) if axes is None else axes.turn
    places = places_on_face(scene, table, middle, measured)
    return tuple(
        fem.PartPoint(
            fem.SpringEnd(face, tuple(places[node].tolist()), table.radius),
            turn @ np.eye(3)[axis], node,
        )
        for node, axis in zip(measured.node, measured.axis, strict=True)
    )  # fmt: skip


def places_on_face(
    scene: Scene, table: MeasuredTable, middle: fem.SurfacePoint, measured: PartReceptances
) -> dict[int, NDArray[np.float64]]:
    """Place of each node on its face (2,) [m] from the middle along the axes that span it; raises
    ValueError for nodes without a place, and for places off the plane of the face."""
    axes = axes_of_test(scene)
    turn = np.eye(3) if axes is None else axes.turn
    shift = np.zeros(3) if axes is None else axes.shift
    places: dict[int, NDArray[np.float64]] = {}
    for node in dict.fromkeys(measured.node):
        if table.at is not None:
            places[node] = np.array(table.at[table.points.index(node)])
            continue
        if node not in measured.place:
            raise ValueError(
                f"node {node} of {table.receptance!r} has no coordinates (data set 15 or 2411): "
                "say by points and at where the nodes lie on the face"
            )
        away = turn @ measured.place[node] + shift - middle.point
        off = abs(float(away @ middle.inward))
        if off > FARTHEST * table.radius:
            at = np.round(turn @ measured.place[node] + shift, 6).tolist()
            raise ValueError(
                f"node {node} at {at} m lies {off:.3g} m off the plane of {table.on!r}, allowed "
                f"are {FARTHEST:g} radii, {FARTHEST * table.radius:.3g} m: give coordinates in the "
                "axes of the assembly, or [test_axes], or points and at"
            )
        places[node] = np.round(middle.axes @ away, 9) + 0.0
    return places


def sentences(scene: Scene) -> list[str]:
    """Sentences on each measured part: its responses, the error of their fit, its mass as a
    whole."""
    remarks = []
    for table in scene.measured or ():
        part = fitted_part(table)
        measured, fit = part.receptances, part.fit
        kind = "SYNTHETIC, computed, not measured" if part.synthetic else "measured"
        axes_of: dict[int, str] = {}
        for node, axis in zip(measured.node, measured.axis, strict=True):
            axes_of[node] = axes_of.get(node, "") + AXES[axis]
        points = ", ".join(f"{node}{axes}" for node, axes in axes_of.items())
        mass = []
        for a in sorted(set(measured.axis)):
            of_axis = [i for i, axis in enumerate(measured.axis) if axis == a]
            B = fit.free[of_axis]
            if B.size and (square := float(np.mean(np.sum(B**2, axis=1)))) > 0:
                mass.append(f"{1 / square:.3g} kg along {AXES[a]}")
        free = f" Below its modes it moves as free masses ({', '.join(mass)})." if mass else ""
        free += " A part that stands fixed has none: held = true." if mass else ""
        remarks.append(
            f"measured.{table.name} ({kind}: {table.receptance}) is joined to {table.on} at "
            f"{points}: {len(fit.omega)} modes from {measured.frequency_hz[0]:.4g} to "
            f"{measured.frequency_hz[-1]:.5g} Hz miss {fit.error:.2g} of its receptances (rms), "
            f"which differ from their transposes by {fit.asymmetry:.2g}.{free}"
        )
    return remarks


def rigid_motions(part: PartReceptances, flat: float = 1e-3) -> int:
    """In how many ways the measured motions of a part can move rigidly, up to 6; without places of
    its nodes six, or as many as there are motions. A spread of points below `flat` of the largest
    counts as none."""
    axes = np.eye(3)[list(part.axis)]
    if not set(part.node) <= part.place.keys():
        return min(len(axes), 6)
    places = np.array([part.place[node] for node in part.node])
    lever = places - places.mean(axis=0)
    lever /= max(float(np.abs(lever).max()), 1e-12)
    # a point at p moves by t + theta x p, along an axis a by a . t + (p x a) . theta
    G = np.hstack([axes, np.cross(lever, axes)])
    return int(np.linalg.matrix_rank(G, tol=flat * np.linalg.norm(G, 2)))
