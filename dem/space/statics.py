"""Packings at rest: pressed between planes or by steady loads.

Forces balance where the energy of contacts and load is least. A step solves

    (sum of k e e^T over the contacts + mu) du = out of balance force

k the stiffness of a contact, which leaves out what the turning of its line gives back, N / r, some
1e-4 of k: steps still reduce what is out of balance by as much. mu, of Levenberg and Marquardt,
holds spheres that touch nothing.
"""

import numpy as np

from beadwave.dem.kernels.arguments import Array
from beadwave.dem.space.packing import Packing
from beadwave.dem.statics import NoEquilibrium

# out of balance over the largest contact force; of overlaps of 1e-7 m rounding leaves 1e-11
ENOUGH = 1e-9


def lines(packing: Packing, u: Array) -> tuple[Array, Array, Array]:
    """Unit vectors (c, 3) from first to second body, overlaps (c,) [m] and distances (c,) [m] of
    centres, of spheres displaced by u (s, 3) [m]; to a plane the distance is infinite."""
    n, (i, j) = packing.n_pairs, packing.pairs.T
    move = -u[i]
    move[:n] += u[j[:n]]
    span = packing.arm.copy()
    span[:n] += move[:n]
    r = np.linalg.norm(span, axis=1)
    # |X + D| - |X| without the cancellation of that difference, see `kernel`
    rise = np.einsum("cx,cx->c", move, packing.arm + span) / (
        r + np.linalg.norm(packing.arm, axis=1)
    )
    rise[n:] = np.einsum("cx,cx->c", move[n:], packing.arm[n:])
    return span / r[:, None], packing.overlap - rise, np.where(np.arange(len(r)) < n, r, np.inf)


def resultants(packing: Packing, u: Array) -> tuple[Array, Array]:
    """Force (s, 3) [N] of the contacts on each sphere along its guide, and of each contact (c,)."""
    e, overlap, _ = lines(packing, u)
    force = packing.A * np.maximum(overlap, 0.0) ** 1.5
    total = np.zeros_like(u)
    n, (i, j) = packing.n_pairs, packing.pairs.T
    np.add.at(total, i, -force[:, None] * e)
    np.add.at(total, j[:n], (force[:, None] * e)[:n])
    if packing.guides is not None:
        total = np.einsum("sxy,sy->sx", packing.guides.motion, total)
    return total, force


def assembled(packing: Packing, blocks: Array):
    """Sparse (3 s, 3 s) matrix of a spring (3, 3) at each contact, blocks (c, 3, 3)."""
    from scipy import sparse  # a tenth of a second

    n, (i, j) = packing.n_pairs, packing.pairs.T
    places = [(i, i, blocks), (j[:n], j[:n], blocks[:n])]
    places += [(i[:n], j[:n], -blocks[:n]), (j[:n], i[:n], -blocks[:n])]
    rows, columns, values = [], [], []
    x, y = np.divmod(np.arange(9), 3)
    for first, second, block in places:
        rows.append((3 * first[:, None] + x).ravel())
        columns.append((3 * second[:, None] + y).ravel())
        values.append(block.reshape(-1, 9).ravel())
    size = 3 * len(packing.mass)
    return sparse.csc_array(
        (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))), (size, size)
    )


GIVES_WAY = (
    "the packing finds no state of rest where it is pressed, as spheres give way; make its sides "
    "periodic, scatter its radii less, or press it more"
)


def at_rest(packing: Packing, load: Array) -> Packing:
    """The packing in its state of rest under a steady load (s, 3) [N], its planes fixed: places,
    arms and overlaps of that state, and a load that balances its contacts to rounding.

    Raises NoEquilibrium where none is found.
    """
    from scipy.sparse import diags_array
    from scipy.sparse.linalg import splu

    def energy(u):
        _, overlap, _ = lines(packing, u)
        return 0.4 * packing.A @ np.maximum(overlap, 0.0) ** 2.5 - np.sum(load * u)

    guides = packing.guides
    allowed = load if guides is None else np.einsum("sxy,sy->sx", guides.motion, load)
    u = np.zeros((len(packing.mass), 3))
    damping, before = 1e-6, energy(u)
    is_pressed = before > 0.0
    for _ in range(400):
        total, force = resultants(packing, u)
        residual = total + allowed
        scale = max(force.max(initial=0.0), np.abs(allowed).max(initial=0.0))
        if np.abs(residual).max() <= ENOUGH * scale:
            if is_pressed and scale == 0.0:  # all spheres have slipped out of their contacts
                raise NoEquilibrium(GIVES_WAY)
            break
        e, overlap, _ = lines(packing, u)
        k = 1.5 * packing.A * np.sqrt(np.maximum(overlap, 0.0))
        K = assembled(packing, k[:, None, None] * e[:, :, None] * e[:, None, :])
        stiffest = k.max(initial=0.0) or 1.5 * packing.A.max() * (scale / packing.A.max()) ** (
            1 / 3
        )
        for _ in range(40):
            du = splu(K + diags_array(np.full(K.shape[0], damping * stiffest), format="csc")).solve(
                residual.ravel()
            )
            du = du.reshape(-1, 3)
            if guides is not None:
                du = np.einsum("sxy,sy->sx", guides.motion, du)
            after = energy(u + du)
            # near the end energies are alike to rounding, and forces tell
            smaller = (
                np.abs(resultants(packing, u + du)[0] + allowed).max() < np.abs(residual).max()
            )
            if after < before or smaller:
                break
            damping *= 4.0
        else:
            raise NoEquilibrium(GIVES_WAY)
        u, before, damping = u + du, after, max(damping / 10.0, 1e-12)
    else:
        raise NoEquilibrium(
            "the packing finds no state of rest in 400 steps; make its sides periodic, scatter its "
            "radii less, or press it more"
        )

    _, overlap, _ = lines(packing, u)
    n, (i, j) = packing.n_pairs, packing.pairs.T
    arm = packing.arm.copy()
    arm[:n] += u[j[:n]] - u[i[:n]]
    rest = packing._replace(rest=packing.rest + u, arm=arm, overlap=overlap)
    total, _ = resultants(rest, np.zeros_like(u))
    # what is out of balance by rounding is held as well, so that the packing stays
    return rest._replace(load=-total)
