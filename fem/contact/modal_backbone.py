"""Frequency and loss of a mode over its amplitude, by slip and opening of preloaded faces.

The inertia forces of a mode, M phi alpha, load the preloaded assembly quasi-statically up and back:
H. Festjens, G. Chevallier, J.-L. Dion, Int. J. Mech. Sci. 75 (2013) 170; R. M. Lacayo, M. S. Allen,
Mech. Syst. Signal Process. 118 (2019) 133. Modal force alpha over modal displacement q = phi^T M u
is a loop, q = alpha / omega^2 + d_1 . s with the forces s and openings d_1 of
`fem.contact.coulomb_friction`.

The frequency is that of the free motion q'' + alpha(q) = 0 on the loop, from one peak to the other
and back: two half periods, each from its peak at rest to where the motion comes to rest. A loop
loses D, and zeta = D / (4 pi U_max) with U_max on the mean of its two branches; the loss factor is
2 zeta.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from beadwave.fem.assembly.model import Model
from beadwave.fem.contact.coulomb_friction import (
    FrictionInterface,
    Loaded,
    NoEquilibrium,
    SlipState,
    loaded_to,
    moved_on,
)
from beadwave.fem.contact.preloaded_contact import (
    MINDLIN,
    OPEN,
    PreloadedContact,
)

# load steps of a branch: with 32, in loops closed within 0.02, losses differ by 3 % at most, by 1.1
# in the mean
N_STEPS = 8
# `Loop.unclosed` up to which it counts as closed: losses lie off those after many cycles by 0.3 of
# that at most
CLOSED, LOSS_OF_UNCLOSED = 0.1, 0.3
# at one load, of either number of steps: the first ones wear off the shear that the preload left at
# its limit, which at small amplitudes is five times what a cycle loses
MAX_LOOPS = 8
NEGLIGIBLE_LOSS = 1e-6  # of a smaller loss factor the error is that of this one
# a loop that is open by more than SLOW times the one before it moves on by half of what it moved: a
# twelfth of Newton's steps less, and losses of two modes as far off as without, 1.1 % in the mean
WORN_ON, SLOW = 0.5, 0.4
# of the forces of loops at the largest load, and in proportion at smaller ones, whose losses are
# smaller; against 1e-8, losses of two modes lie off by 3.5e-4 and frequencies by 8e-8 at most
CONVERGED_LOOPS = 3e-6
N_AMPLITUDES, LOWEST = 20, 1e-2  # loads, and the least over that which whole bolts would slip at
RESOLVED = 9  # facets that slip, from which on they sample a slip zone


class Loop(NamedTuple):
    """A closed loop: alpha and q along the branch down from its positive peak, and up again."""

    alpha: NDArray[np.float64]  # (2, n) modal force
    q: NDArray[np.float64]  # (2, n) modal displacement
    slipped: NDArray[np.bool_]  # (s,) facets that slipped in it
    end: SlipState
    # work of friction by which its end lies off its beginning, over that of the loop; 0 is closed
    unclosed: float
    forces: NDArray[np.float64]  # (2, n, m + 2 s) [N] s at its points
    by_half: "Loop | None" = None  # the closed loop of half as many steps, which led to it

    @property
    def amplitude(self) -> float:
        """Half of its width in q."""
        return float(self.q[0, 0] - self.q[0, -1]) / 2

    @property
    def dissipated(self) -> float:
        """D, the area [J]."""
        return float(sum(np.trapezoid(*branch) for branch in zip(self.alpha, self.q, strict=True)))

    @property
    def damping_ratio(self) -> float:
        """zeta = D / (4 pi U_max), U_max from the middle to a peak on the mean of both branches."""
        q = np.union1d(*self.q)
        up, down = np.interp(q, *self._rising(1)), np.interp(q, *self._rising(0))
        mean = (up + down) / 2
        stored = np.trapezoid(np.abs(mean - np.interp(0.0, mean, mean)), q) / 2
        return max(self.dissipated, 0.0) / (4 * np.pi * stored)

    @property
    def frequency(self) -> float:
        """[Hz] of the free motion on it, two half periods from peaks at rest."""
        return 1.0 / sum(half_period(q, alpha) for q, alpha in zip(self.q, self.alpha, strict=True))

    @property
    def is_monotone(self) -> bool:
        """True where q falls along the first branch and rises along the second. It does not where
        bodies roll on round faces: the geometric stiffness of their pressure, which W leaves out,
        is as large as that of their contact."""
        down, up = np.diff(self.q, axis=1)
        return bool(np.all(down < 0) and np.all(up > 0))

    def forces_at(self, branch: int, alpha: float) -> NDArray[np.float64]:
        """s (m + 2 s,) [N] at a load of a branch, linear between its points."""
        n = self.alpha.shape[1] - 1
        first, last = self.alpha[branch, [0, -1]]
        place = (alpha - first) / (last - first) * n
        i = min(int(place), n - 1)
        share = place - i
        return (1 - share) * self.forces[branch, i] + share * self.forces[branch, i + 1]

    def _rising(self, branch: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """q and alpha of a branch, by rising q."""
        order = np.argsort(self.q[branch], kind="stable")
        return self.q[branch][order], self.alpha[branch][order]


def half_period(q: NDArray[np.float64], alpha: NDArray[np.float64]) -> float:
    """[s] from rest at the first of the points (n,) of a branch until the motion q'' = -alpha(q)
    comes to rest again; alpha is linear between the points, and past the last as before it."""
    sign = 1.0 if q[-1] > q[0] else -1.0
    x, force = sign * (q - q[0]), -sign * alpha
    # in each piece x'' = force + slope (x - x_i), slope = -omega^2
    time, square = 0.0, 0.0
    for i in range(len(x) - 1):
        width = x[i + 1] - x[i]
        if width <= 0:
            continue
        omega = np.sqrt(max((force[i] - force[i + 1]) / width, 1e-300))
        after = square + (force[i] + force[i + 1]) * width
        last = i == len(x) - 2
        # phase of the oscillation about the point where the force would vanish
        begin = np.arctan2(np.sqrt(square) * omega, force[i])
        if after > 0 and not last:
            end = np.arctan2(np.sqrt(after) * omega, force[i + 1])
            time, square = time + (end - begin) / omega, after
        else:
            return time + (np.pi - begin) / omega
    raise ValueError("a branch has at least two points.")


def loops(loaded: Loaded, alphas: Sequence[float], n_steps: int = N_STEPS) -> Iterator[Loop]:
    """A closed loop of 2 n_steps for each of the rising loads, each begun where the one before it
    ended; raises NoEquilibrium for a load that the faces cannot carry.

    Loops of half as many steps wear off what the load before has left. Forces converge to
    `loaded.converged` at the last load, and in proportion at those before it.
    """
    interface, at_last = loaded.interface, loaded.converged
    state = SlipState(0.0, np.zeros(len(interface.W)), np.zeros(len(interface.stuck), bool))
    loop = None
    for peak in alphas:
        # in steps as those of the loops that follow
        rise = int(np.ceil((peak - state.alpha) / peak * n_steps / 4))
        loaded = loaded._replace(converged=at_last * peak / alphas[-1])
        state, worn = loaded_to(loaded, state, peak, rise), None
        for n in (n_steps // 2, n_steps):
            last = np.inf
            for _ in range(MAX_LOOPS):
                start = state
                loop = cycle(loaded, start, n, loop)
                state = loop.end
                if loop.unclosed <= CLOSED:
                    break
                # what closes fast would overshoot
                if loop.unclosed > SLOW * last:
                    state = moved_on(loaded, start, state, WORN_ON)
                last = loop.unclosed
            worn = loop._replace(by_half=worn)
        yield worn


def cycle(loaded: Loaded, peak: SlipState, n_steps: int, before: Loop | None = None) -> Loop:
    """The loop down and up again from a state at a positive peak; the loop before it, at that peak
    or a lower one, gives guesses."""
    interface, state = loaded.interface, peak
    scale = 1.0 if before is None else peak.alpha / before.alpha[0, 0]
    branches, forces, ends, slipped = [], [], [peak], np.zeros(len(peak.slips), bool)
    for branch, end in enumerate((-peak.alpha, peak.alpha)):
        points, at = [(state.alpha, loaded.displacement(state.alpha, state.s))], [state.s]
        alphas = np.linspace(state.alpha, end, n_steps + 1)[1:]
        for alpha in alphas:
            guess = None
            if before is not None:
                guess = before.forces_at(branch, alpha / scale)
                guess -= before.forces_at(branch, state.alpha / scale)
                guess = state.s + scale * guess
            state = loaded_to(loaded, state, alpha, guess=guess)
            slipped |= state.slips
            points.append((alpha, loaded.displacement(alpha, state.s)))
            at.append(state.s)
        branches.append(np.array(points))
        forces.append(at)
        ends.append(state)

    # s across changes by k times the slip
    limit = interface.friction * interface.force[interface.stuck] / interface.across

    def work(first: SlipState, last: SlipState) -> float:
        """Friction times the slip from one state to another."""
        return float(np.abs(last.s - first.s)[interface.m :].reshape(2, -1).sum(axis=0) @ limit)

    alpha, q = np.moveaxis(np.array(branches), 2, 0)
    negligible = NEGLIGIBLE_LOSS * peak.alpha * abs(q[0, 0] - q[0, -1])
    whole = max(work(*ends[:2]) + work(*ends[1:]), negligible)
    return Loop(alpha, q, slipped, state, work(ends[0], ends[2]) / whole, np.array(forces))


class ModalBackbone(NamedTuple):
    """Frequency and loss of a mode at k amplitudes that rise."""

    displacement: NDArray[np.float64]  # (k,) [m] of the point that moves most
    frequency: NDArray[np.float64]  # (k,) [Hz]
    loss_factor: NDArray[np.float64]  # (k,)
    dissipated: NDArray[np.float64]  # (k,) [J] in a cycle
    slip_share: NDArray[np.float64]  # (k,) area that slips over the closed one
    error: NDArray[np.float64]  # (k,) relative, of frequency or loss factor: the larger one
    loss_deviation: NDArray[np.float64]  # (k,) of the loss factor
    first_slip: NDArray[np.float64]  # (m,) [m] displacement from which on a facet slips; nan: never
    slips_whole: bool  # the faces carry no more than the last amplitude
    largest: float  # [kg^-1/2] displacement of the point that moves most, mass-normalised
    rolls: bool = False  # beyond the last amplitude bodies roll on their faces, see `is_monotone`


def friction_interface(model: Model) -> tuple[FrictionInterface, csr_matrix]:
    """The faces of a model about its preloaded state, condensed on it, and the openings
    (m + 2 s, n) of the free dofs that its rows are."""
    contact: PreloadedContact = model.contact
    area, m = contact.facets.area, len(contact.pressure)
    stuck = np.flatnonzero((contact.state != OPEN) & (contact.friction > 0))

    # the geometric stiffness is left out of W, as it changes frequencies by parts in a thousand
    rows = np.concatenate([np.arange(m), m + stuck, 2 * m + stuck])
    C = contact.C[rows]
    W, _ = contact.interface.changed(contact.layers, rows, np.zeros(contact.C.shape[0]))
    k = area / (1 / contact.hard + contact.rough)
    interface = FrictionInterface(
        W=W,
        stuck=stuck,
        closed=contact.state != OPEN,
        normal=k,
        force=contact.pressure * area,
        gap=np.where(contact.state == OPEN, contact.gap, 0.0),
        across=(MINDLIN * k - contact.bolts * area)[stuck],
        shear=contact.shear[:, stuck],
        friction=contact.friction[stuck],
    )
    return interface, C


def whole_slip(loaded: Loaded, groups: NDArray[np.int64]) -> float:
    """Load at which a group of facets, groups (m,), would slip as a whole: their shear in the
    linear model, summed by size, is friction times pressure. inf without shear."""
    interface = loaded.interface
    stuck, m = interface.stuck, interface.m
    of_stuck = groups[stuck]
    limit = np.bincount(of_stuck, interface.friction * interface.force[stuck])
    shear = np.bincount(of_stuck, interface.across * np.hypot(*loaded.openings[m:].reshape(2, -1)))
    moved = shear > 1e-12 * shear.max(initial=0.0)
    return float(np.min(limit[moved] / shear[moved], initial=np.inf))


def modal_backbone(
    loaded: Loaded, area: NDArray[np.float64], groups: NDArray[np.int64], largest: float
) -> ModalBackbone:
    """The backbone of a mode up to the load at which the first group of facets, groups (m,) with
    areas (m,) [m^2], would slip as a whole. `largest` [kg^-1/2] is the displacement of the point
    that moves most in the mass-normalised mode."""
    loaded = loaded._replace(converged=CONVERGED_LOOPS)
    interface = loaded.interface
    end = whole_slip(loaded, groups)
    alphas = np.geomspace(LOWEST, 1.0, N_AMPLITUDES) * end if np.isfinite(end) else []
    fine, slips_whole, rolls = [], False, False
    try:
        for loop in loops(loaded, alphas):
            rolls = not (loop.is_monotone and loop.by_half.is_monotone)
            if rolls:
                break
            fine.append(loop)
    except NoEquilibrium:
        slips_whole = True

    hz, loss = np.array([(b.frequency, 2 * b.damping_ratio) for b in fine]).reshape(-1, 2).T
    coarse = [loop.by_half for loop in fine]
    by_half = np.array([(b.frequency, 2 * b.damping_ratio) for b in coarse]).reshape(-1, 2).T
    closed = area[interface.closed].sum()
    displacement = np.array([largest * loop.amplitude for loop in fine])
    slipping = [area[interface.stuck[loop.slipped]] for loop in fine]
    n_facets = np.array([a.sum() ** 2 / max(a @ a, 1e-300) for a in slipping])
    unclosed = LOSS_OF_UNCLOSED * loss * np.array([loop.unclosed for loop in fine])
    sampled = facet_deviation(displacement, loss, n_facets)
    deviation = np.sqrt((by_half[1] - loss) ** 2 + sampled**2 + unclosed**2)
    first_slip = np.full(interface.m, np.nan)
    for loop, at in zip(fine[::-1], displacement[::-1], strict=True):
        first_slip[interface.stuck[loop.slipped]] = at
    return ModalBackbone(
        displacement,
        hz,
        loss,
        np.array([max(loop.dissipated, 0.0) for loop in fine]),
        np.array([a.sum() / closed for a in slipping]),
        np.maximum(np.abs(by_half[0] / hz - 1), deviation / np.maximum(loss, NEGLIGIBLE_LOSS)),
        deviation,
        first_slip,
        slips_whole,
        largest,
        rolls,
    )


def facet_deviation(
    displacement: NDArray[np.float64],
    loss_factor: NDArray[np.float64],
    n_facets: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Standard deviation (k,) of loss factors at amplitudes (k,) [m] that rise, as n_facets (k,) of
    like size that slip sample the slip zone: 1 / sqrt(n) of it.

    Where fewer than RESOLVED slip, the distance from a loss factor in proportion to the amplitude,
    through the first point with as many, comes to that: partial slip loses with the cube of the
    force (R. D. Mindlin, H. Deresiewicz, J. Appl. Mech. 20 (1953) 327). Two meshes of bolted plates
    differ by 0.7 of the deviations of both in the mean, by 3.1 at most.
    """
    if not len(displacement):
        return np.zeros(0)
    resolved = np.append(np.flatnonzero(n_facets >= RESOLVED), len(n_facets) - 1)[0]
    by_law = loss_factor[resolved] * displacement / displacement[resolved]
    sampled = loss_factor / np.sqrt(np.maximum(n_facets, 1.0))
    few = np.arange(len(n_facets)) < resolved
    return sampled + np.where(few, np.abs(by_law - loss_factor), 0.0)
