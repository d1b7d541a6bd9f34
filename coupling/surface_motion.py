"""Motion of the outer nodes of a reduced structure in each of its wall's modes.

u(X, t) = sum_k q_k(t) phi_k(X),   phi_k = T_surface v_k
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from beadwave.coupling.reduced_spatial_wall import modes_and_oscillators
from beadwave.coupling.reduced_wall import moving_mask, moving_modes, with_oscillator
from beadwave.rom import ModalWall, ReducedModel, modal


class SurfaceModes(NamedTuple):
    """Modes at the m outer nodes of a structure."""

    omega: np.ndarray  # (k,) [rad/s]
    shape: np.ndarray  # (k, m, 3) [kg^-1/2]


def wall_modes(
    reduced: ReducedModel, omega: np.ndarray, phi: np.ndarray, *, cutoff_hz: float | None = None
) -> SurfaceModes:
    """Shapes of the wall's modes, which are known by their omega [rad/s] and phi [kg^-1/2] (k,), of
    several chains (p, k); `cutoff_hz` is that with which the wall was made of the model. A shape is
    that of the nearest mode: where the wall was made of another model it is not that of the
    wall."""
    weights = reduced.contact.weights_read
    if weights is not None and cutoff_hz is None:
        cutoff_hz = np.inf
    modes = modal(reduced)
    mask = moving_mask(modes, reduced, cutoff_hz)
    if np.ndim(phi) == 2:  # oscillators for the rest at all contacts
        columns = np.column_stack([reduced.w, reduced.columns.load])
        moving = modes_and_oscillators(reduced, columns, cutoff_hz)
        moving, phi = moving._replace(phi=moving.phi[:, 0]), phi[0]
    else:
        moving = with_oscillator(modes, mask) if weights is None else moving_modes(modes, mask)
    at_contact = moving.phi if weights is None else weights @ moving.vectors
    # the nearest in frequency, and of equal ones that of the participation
    distance = np.abs(moving.omega[:, None] - omega) / (omega + 1e-9 * omega.max(initial=1.0))
    distance += 1e-3 * np.abs(at_contact[:, None] - phi) / np.abs(phi).max(initial=1e-300)
    return _surface_modes(reduced, moving, distance.argmin(axis=0))


def structure_modes(reduced: ReducedModel, frequency_hz: np.ndarray) -> SurfaceModes:
    """Shapes of the reduced structure's modes at these frequencies (k,), to a thousandth; omega is
    nan where it has none."""
    modes, omega = modal(reduced), 2 * np.pi * np.asarray(frequency_hz)
    distance = np.abs(modes.omega[:, None] - omega) / np.maximum(omega, 1e-300)
    nearest = distance.argmin(axis=0) if len(omega) else np.zeros(0, int)
    shapes = _surface_modes(reduced, modes, nearest)
    missed = distance.min(axis=0, initial=np.inf) > 1e-3
    return shapes._replace(omega=np.where(missed, np.nan, shapes.omega))


def _surface_modes(reduced: ReducedModel, modes: ModalWall, index: np.ndarray) -> SurfaceModes:
    """The modes of an index (k,) at the outer nodes."""
    flat = reduced.surface.T @ modes.vectors[:, index].astype(np.float32)
    return SurfaceModes(modes.omega[index], flat.T.reshape(len(index), -1, 3))


class Shapes(NamedTuple):
    """Shapes (k, m, 3) on the outer nodes; for each wall mode and each listed mode the index of its
    shape."""

    shape: np.ndarray
    of_wall: list[int]  # (n_wall_modes,) -1 where it was left out
    of_mode: list[int]  # one for each mode listed, -1 where the model has none


class SurfaceMotion(NamedTuple):
    """The wall's modes in a run, at n instants."""

    omega: np.ndarray  # (k,) [rad/s]
    phi: np.ndarray  # (k,) [kg^-1/2], of several chains (p, k)
    q: np.ndarray  # (n, k) [kg^1/2 m]
    cutoff_hz: float | None  # with which the wall was made; None: the usual one


def shown_shapes(
    reduced: ReducedModel, frequency_hz: Sequence[float], moved: SurfaceMotion | None
) -> Shapes:
    """Shapes of the wall's modes that are visible in a run, and of listed modes that are not among
    them. The smallest modes are left out as long as together they move no node by more than a
    thousandth of the largest displacement."""
    listed = structure_modes(reduced, np.array(frequency_hz))
    exists = listed.omega > 0
    if moved is None:
        return Shapes(listed.shape[exists], [], _numbered(exists).tolist())

    # wall modes: without the smallest that together stay below a thousandth, but for listed ones
    wall = wall_modes(reduced, moved.omega, moved.phi, cutoff_hz=moved.cutoff_hz)
    same = np.isclose(listed.omega[:, None], wall.omega, rtol=1e-9, atol=0)
    largest = np.abs(moved.q - moved.q[0]).max(axis=0) * np.abs(wall.shape).max(axis=(1, 2))
    order = np.argsort(largest)
    visible = np.ones(len(largest), dtype=bool)
    visible[order[np.cumsum(largest[order]) <= 1e-3 * largest.max(initial=0.0)]] = False
    visible |= same.any(axis=0)

    # then the listed modes that are none of the wall's
    alone, place = exists & ~same.any(axis=1), _numbered(visible)
    place_alone = np.where(alone, visible.sum() + _numbered(alone), -1)
    of_mode = np.where(same.any(axis=1), place[same.argmax(axis=1)], place_alone)
    shapes = np.concatenate([wall.shape[visible], listed.shape[alone]])
    return Shapes(shapes, place.tolist(), of_mode.tolist())


def _numbered(mask: np.ndarray) -> np.ndarray:
    """Numbers 0, 1, 2, ... of the True elements of a mask (n,), -1 for the others."""
    return np.where(mask, np.cumsum(mask) - 1, -1)
