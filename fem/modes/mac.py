"""Correlation of modes: identified by a body's motion, by number, or by measured shapes.

The order of frequencies does not identify modes: those of soft parts lie between those of stiff
ones, and move with the joints. What does is the share of a mode's kinetic energy in a body's rigid
motion ("x", "x+ry"), the share of its strain energy in a body ("strain"), or the modal assurance
criterion with a measured shape.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment
from scipy.sparse import csr_matrix

from beadwave.fem.assembly.joints import rigid_motion
from beadwave.fem.assembly.model import Model
from beadwave.fem.modes.modes import Modes

RIGID = 1e-4  # frequency over the highest one, below which a mode is a rigid-body motion
SPRINGS = "springs:"  # before the name of springs between points among the bodies
MOTIONS = ("x", "y", "z", "rx", "ry", "rz")
STRAIN = "strain"


class BodyMotion(NamedTuple):
    """A mode identified by what a body does in it."""

    body: str
    motion: str  # of MOTIONS, or several as "x+ry"; or STRAIN

    @property
    def directions(self) -> list[int]:
        """Positions in MOTIONS, none for STRAIN; raises ValueError for what is neither."""
        if self.motion == STRAIN:
            return []
        try:
            return [MOTIONS.index(name) for name in self.motion.split("+")]
        except ValueError:
            raise ValueError(
                f"motion = {self.motion!r} of {self.body} must be a sum of {', '.join(MOTIONS)}, "
                f'as in "x+ry", or "{STRAIN}".'
            ) from None


class Number(NamedTuple):
    """A mode identified by its number, from 1, among those that strain bodies or joints. Rigid
    motions do not count, neither free ones nor those on springs between points."""

    number: int


class Shape(NamedTuple):
    """A mode identified by a measured shape."""

    reading: NDArray[np.float64] | csr_matrix  # (m, n) reads a model where and how the test did
    shape: NDArray[np.complex128]  # (m,) measured
    hz: float  # measured

    def within(self, V: NDArray[np.float64]) -> "Shape":
        """The shape in coordinates q (j,) of u = V @ q, V (n, j)."""
        return self._replace(reading=self.reading @ V)


Target = BodyMotion | Number | Shape


class Pairing(NamedTuple):
    """The targets among computed modes."""

    index: NDArray[np.int64]  # (n_targets,) position in the modes, -1 where none fits
    score: NDArray[np.float64]  # (n_targets,) its share of the energy, or MAC
    character: NDArray[np.float64]  # (n_targets, k) the same for every mode


class BodyForms(NamedTuple):
    """Energies and rigid motions of one body in coordinates q (m,) of u = V @ q; of springs between
    points the strain energy alone."""

    K: NDArray[np.float64]  # (m, m) its strain energy is q^T K q / 2
    M: NDArray[np.float64]  # (m, m) its kinetic energy v^T M v / 2
    rigid: NDArray[np.float64]  # (6, m) its momenta in shifts x y z and turns, mass-normalised


def mac(phi: NDArray, psi: NDArray) -> NDArray[np.float64]:
    """Modal assurance criterion |phi^H psi|^2 / (phi^H phi psi^H psi), (k, l), of shapes phi (m, k)
    and psi (m, l), real or complex, at the same m readings; nan for a shape that is zero there.

    Allemang and Brown, Proc. 1st Int. Modal Analysis Conf. (1982).
    """
    cross = np.abs(phi.conj().T @ psi) ** 2
    return cross / np.outer(*(np.sum(np.abs(a) ** 2, axis=0) for a in (phi, psi)))


def mac_near_double(
    measured: NDArray, computed: NDArray, computed_hz: NDArray[np.float64], *, near: float = 0.04
) -> NDArray[np.float64]:
    """MAC (n, k) of measured shapes (m, n) with computed modes (m, k) of frequencies (k,), each
    together with its near-double neighbours; nan for a shape that is zero at the m readings.

    A structure that differs from its model by little turns a pair of nearly one frequency within
    its plane, by about that difference over the distance d = |ln f / f'| of the two. So a measured
    shape x is compared with all combinations of a mode phi_j and its neighbours phi_l,

        1 - min (|x - phi_j a_j - sum_l phi_l a_l|^2 + sum_l c_l |a_l|^2 |phi_j|^2) / |x|^2,
        c = 1 / w - 1,  w = (1 - (d / near)^2)^2 for d < near:

    with a double mode the square of the cosine of the angle between shape and plane, with a mode
    that is alone the MAC. The weight w is smooth, so that a mesh that splits a pair changes little.
    `near`: measured doubles of plates and discs differ by 1 to 3 %.
    """
    likeness = mac(measured, computed)
    ln_hz = np.log(np.maximum(computed_hz, 1e-9))
    distance = np.abs(np.subtract.outer(ln_hz, ln_hz)) / near
    total = np.sum(np.abs(measured) ** 2, axis=0)
    gram, loads = computed.conj().T @ computed, computed.conj().T @ measured

    # least squares by the normal equations (gram + c |phi_j|^2) a = loads, of all modes with as
    # many neighbours at once: a posterior asks for this a hundred thousand times
    n_near = np.sum(distance < 1, axis=1)
    n_near[~(gram.diagonal().real > 0)] = 1
    for n in np.unique(n_near[n_near > 1]):
        modes = np.flatnonzero(n_near == n)
        S = np.nonzero(distance[modes] < 1)[1].reshape(-1, n)  # each mode and its neighbours
        weight = np.maximum((1 - distance[modes[:, None], S] ** 2) ** 2, 1e-12)
        c = gram[modes, modes].real[:, None] * (1 / weight - 1)
        normal = gram[S[:, :, None], S[:, None, :]] + c[:, :, None] * np.eye(n)
        a = np.linalg.pinv(normal, rcond=1e-13, hermitian=True) @ loads[S]
        explained = np.sum(loads[S].conj() * a, axis=1).real.T
        likeness[:, modes] = explained / np.where(total > 0, total, np.nan)[:, None]
    return likeness


class ShapeMatch(NamedTuple):
    """Limits of the pairing of a measured and a computed mode, and of its doubt."""

    spread: float = 0.3  # ln of the frequencies' ratio that costs as much as a MAC lower by 0.4
    smallest: float = 0.3  # MAC of a pair, at least
    farthest: float = 2.0  # ratio of frequencies of a pair, at most
    doubtful: float = 0.2  # relative difference of frequencies from which a pair is doubtful
    rival: float = 0.8  # of the pair's likeness: a runner-up that makes it doubtful
    alike: float = 0.8  # MAC at the sensors of two computed modes that these cannot tell apart
    double: float = 0.01  # relative distance of computed modes that form one plane, not rivals


# of targets: a start far from the measured frequencies keeps its pairs as it is tuned to them
FROM_AFAR = ShapeMatch(spread=1.0, farthest=10.0)


# share of its strain energy in these springs: 1 - 1e-6 of a box on cords, 1e-6 of its bending
SUSPENDED_SHARE = 0.5


class MeasuredPairs(NamedTuple):
    """Measured modes paired one-to-one with computed ones, and what else they might be."""

    index: NDArray[np.int64]  # (n,) of the computed mode, -1 where none fits
    runner_up: NDArray[np.int64]  # (n,) the next most like computed mode, -1 where there is none
    doubts: list[tuple[str, ...]]  # n of sentences


def measured_pairs(
    measured_hz: NDArray[np.float64],
    computed_hz: NDArray[np.float64],
    likeness: NDArray[np.float64],
    auto_mac: NDArray[np.float64],
    options: ShapeMatch = ShapeMatch(),
) -> MeasuredPairs:
    """Pairs of n measured and k computed modes, from their MAC `likeness` (n, k) and frequencies.

    The sum of MAC exp(-(ln f / f')^2 / (2 spread^2)) over all pairs is the largest (assignment).
    The largest MAC alone does not do: at few points shapes of distant frequencies look alike.
    `auto_mac` (k, k) is the MAC of the computed modes among themselves at the sensors.
    """
    # one to one, and for each measured mode what speaks against its pair: a distance in frequency,
    # a rival that is nearly as like, or modes that these sensors cannot tell apart
    auto_mac = np.nan_to_num(auto_mac)
    index, score, allowed = one_to_one(measured_hz, computed_hz, likeness, options)
    runner_up, doubts = np.full(len(measured_hz), -1), []
    for i, j in enumerate(index):
        # the next best computed mode, whether or not it is another one's pair
        rivals = np.where(allowed[i], score[i], 0.0)
        rivals[j if j >= 0 else []] = 0.0
        second = int(rivals.argmax()) if rivals.size else -1
        if second >= 0 and rivals[second] > 0:
            runner_up[i] = second

        # sentences for a reader who decides: nothing is dropped here
        sentences = []
        if j >= 0:
            of_plane = np.abs(computed_hz / max(computed_hz[j], 1e-9) - 1) < options.double
            apart = computed_hz[j] / measured_hz[i] - 1
            if abs(apart) > options.doubtful:
                sentences.append(f"doubtful: the frequencies are {100 * abs(apart):.0f} % apart")
            rivals[of_plane] = 0.0
            second = int(rivals.argmax())
            if rivals[second] > options.rival * score[i, j]:
                sentences.append(f"doubtful: {computed_hz[second]:.2f} Hz fits nearly as well")
            if np.count_nonzero(of_plane) > 1:
                listed = ", ".join(f"{f:.2f}" for f in computed_hz[of_plane])
                sentences.append(f"compared with the plane of the modes at {listed} Hz")
            similar = (auto_mac[j] > options.alike) & (np.arange(len(computed_hz)) != j)
            if similar.any():
                listed = ", ".join(f"{f:.2f}" for f in computed_hz[similar][:3])
                ellipsis = ", ..." if np.count_nonzero(similar) > 3 else ""
                sentences.append(f"these points cannot tell its shape from {listed}{ellipsis} Hz")
        doubts.append(tuple(sentences))
    return MeasuredPairs(index, runner_up, doubts)


def one_to_one(
    measured_hz: NDArray[np.float64],
    computed_hz: NDArray[np.float64],
    likeness: NDArray[np.float64],
    options: ShapeMatch,
) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.bool_]]:
    """The computed mode of each measured one, -1 where none fits, the score of every pair (n, k),
    and whether it may be one; see `measured_pairs`."""
    # a mode that no sensor sees has the MAC 0 / 0
    likeness = np.nan_to_num(likeness)
    distance = np.log(np.divide.outer(measured_hz, np.maximum(computed_hz, 1e-9)))
    score = likeness * np.exp(-0.5 * (distance / options.spread) ** 2)
    allowed = (likeness >= options.smallest) & (np.abs(distance) <= np.log(options.farthest))
    rows, columns = linear_sum_assignment(np.where(allowed, score, 0.0), maximize=True)
    index = np.full(len(measured_hz), -1)
    matched = allowed[rows, columns]
    index[rows[matched]] = columns[matched]
    return index, score, allowed


def pair(model: Model, modes: Modes, targets: Sequence[Target]) -> Pairing:
    """The targets among the modes of a model, as `paired`; the energies of bodies and springs are
    those in the modes themselves."""
    bodies = {target.body for target in targets if isinstance(target, BodyMotion)}
    forms = {body: body_forms(model, body, modes.phi) for body in bodies}
    forms |= spring_forms(model, modes.phi)
    by_mode = [t.within(modes.phi) if isinstance(t, Shape) else t for t in targets]
    return paired(forms, modes._replace(phi=np.eye(len(modes.omega))), by_mode)


def paired(
    forms: Mapping[str, BodyForms],
    modes: Modes,
    targets: Sequence[Target],
    *,
    smallest: float = 0.3,
    match: ShapeMatch = FROM_AFAR,
) -> Pairing:
    """The targets among modes in the coordinates of the bodies' energies `forms`.

    A target by motion is the first mode whose share of the energy reaches half of the largest one;
    targets by shape are paired one-to-one, on MAC and frequency together. No mode with a share or
    MAC below `smallest` is paired.
    """
    # how much of each target every mode is: 1 for its number, MAC with its shape, share of the
    # kinetic energy in its motion, or of the strain energy in its body
    elastic = strains(modes, forms)
    character = np.zeros((len(targets), len(modes.omega)))
    for i, target in enumerate(targets):
        if isinstance(target, Number):
            character[i] = elastic & (np.cumsum(elastic) == target.number)
            continue
        if isinstance(target, Shape):
            continue
        form, directions = forms[target.body], target.directions
        if directions:
            character[i] = ((form.rigid[directions] @ modes.phi) ** 2).sum(axis=0)
            continue
        # strain energy of the body over that of the mode, omega^2 / 2; rigid motions have neither
        strain = np.sum(modes.phi * (form.K @ modes.phi), axis=0)
        omega = np.where(elastic, modes.omega, 1.0)
        character[i] = np.where(elastic, strain / omega**2, 0.0)

    # shapes that were measured at the same points together
    shapes = [i for i, target in enumerate(targets) if isinstance(target, Shape)]
    remaining = shapes
    while remaining:
        reading = targets[remaining[0]].reading
        same = [i for i in remaining if np.array_equal(targets[i].reading, reading, equal_nan=True)]
        measured = np.column_stack([targets[i].shape for i in same])
        character[same] = mac_near_double(measured, reading @ modes.phi, modes.frequency_hz)
        remaining = [i for i in remaining if i not in same]

    # the first mode that has half of the largest share: a soft neighbour that joins in less is
    # passed over, and of two that share the motion the lower one counts
    threshold = 0.5 * character.max(axis=1, keepdims=True, initial=0.0)
    eligible = character >= np.maximum(threshold, smallest)
    index = np.where(eligible.any(axis=1), eligible.argmax(axis=1), -1)
    if shapes:
        measured_hz = np.array([targets[i].hz for i in shapes])
        match = match._replace(smallest=smallest)
        index[shapes] = one_to_one(measured_hz, modes.frequency_hz, character[shapes], match)[0]
    score = np.where(index >= 0, character[range(len(targets)), index], 0.0)
    return Pairing(index, score, character)


def strains(modes: Modes, forms: Mapping[str, BodyForms]) -> NDArray[np.bool_]:
    """True for modes (k,) that strain bodies or joints; the others are rigid motions, free or on
    springs between points."""
    in_springs = sum(
        (
            np.sum(modes.phi * (form.K @ modes.phi), axis=0)
            for name, form in forms.items()
            if name.startswith(SPRINGS)
        ),
        start=np.zeros(len(modes.omega)),
    )
    elastic = modes.omega > RIGID * modes.omega.max()
    return elastic & (in_springs < SUSPENDED_SHARE * modes.omega**2)


def strained(model: Model, modes: Modes) -> NDArray[np.bool_]:
    """True for modes (k,) of a model that strain bodies or joints (`strains`): those that are
    numbered."""
    of_modes = modes._replace(phi=np.eye(len(modes.omega)))
    return strains(of_modes, spring_forms(model, modes.phi))


def spring_forms(model: Model, V: NDArray[np.float64]) -> dict[str, BodyForms]:
    """Energies of the springs between points, SPRINGS + "name.kx", for displacements V (n, m) of a
    model's free dofs."""
    m, forms = V.shape[1], {}
    for spring in model.structure.springs:
        r = spring.B @ (model.T @ V)
        energy = spring.stiffness * (r.T @ r)
        forms[f"{SPRINGS}{spring.name}"] = BodyForms(energy, np.zeros((m, m)), np.zeros((6, m)))
    return forms


def body_forms(model: Model, body: str, V: NDArray[np.float64]) -> BodyForms:
    """Energies and rigid motions of a body for displacements V (n, m) of a model's free dofs.

    Momenta are those along six rigid motions R that are orthonormal in the body's own mass,
    R^T M R = 1, so that the square of (M R)^T u is the share of a mode's kinetic energy in each.
    """
    structure, dofs = model.structure, model.structure.dofs(body)
    u, K, M = model.T[dofs] @ V, structure.K[dofs][:, dofs], structure.M[dofs][:, dofs]
    for mass in structure.carried:  # a density has no part in these
        M = M - mass.M[dofs][:, dofs]

    # rigid motions about the centre of mass, where shifts and turns do not couple; turns about its
    # axes by Cholesky: R L^-T with L L^T = R^T M R
    nodes = structure.points[dofs[0::3] // 3]
    lumped = np.asarray(M.sum(axis=1)).ravel()[0::3]
    centre_of_mass = lumped @ nodes / lumped.sum()
    R = rigid_motion(nodes, centre_of_mass)
    R = R @ np.linalg.inv(np.linalg.cholesky(R.T @ (M @ R))).T
    return BodyForms(u.T @ (K @ u), u.T @ (M @ u), (M @ R).T @ u)


def target_mac(
    models: tuple[Model, Model], shapes: tuple[NDArray, NDArray], targets: Sequence[Target]
) -> NDArray[np.float64]:
    """MAC (k, n_targets) of shapes phi (n, k) of one model with psi (m, n_targets) of another on
    the same mesh, one for each target: on the body that it names, or on all bodies."""
    phi, psi = (model.T @ shape for model, shape in zip(models, shapes, strict=True))
    structure = models[0].structure
    columns = []
    for j, target in enumerate(targets):
        has_body = isinstance(target, BodyMotion)
        dofs = structure.dofs(target.body) if has_body else slice(None)
        columns.append(mac(phi[dofs], psi[dofs, j : j + 1])[:, 0])
    return np.array(columns).reshape(len(targets), phi.shape[1]).T


def effective_mass(model: Model, phi: NDArray[np.float64]) -> NDArray[np.float64]:
    """Share (k, 3) of the total mass that each mode phi_k of phi (n, k), mass-normalised, carries
    along x, y and z: (phi_k^T M e)^2 / e^T M e, with e a unit shift of the whole structure. Those
    of all modes add up to 1, less the share of mass at dofs that are held."""
    structure = model.structure
    R = rigid_motion(structure.points, np.zeros(3))[:, :3]
    inertia = structure.M @ R
    return (phi.T @ (model.T[: len(R)].T @ inertia)) ** 2 / np.sum(R * inertia, axis=0)
