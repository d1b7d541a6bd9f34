"""Modes from frequency responses to several references, with deviations (p-LSCF, then ML).

The responses H (p points, m references) are a right matrix fraction in z = exp(-i omega dt),

    H(omega) = B(z) A(z)^-1,   A (m, m) = sum_r A_r z^r,  A_0 = 1,

whose equations B - H A = 0 are linear. B is eliminated; A of every order comes from one Gram
matrix, its poles and participation factors from the companion matrix. With A_0 = 1 the poles that
fit noise mostly grow in time and are dropped. A mode is a pole that recurs from order to order with
its participation factors, and in the two halves of the hits.

The modal model (residues: least squares frequency domain, LSFD)

    H_pj = sum_i [phi_pi l_ij / (i omega - lambda_i) + conj.] + u_pj / omega^2 + v_pj + ...

then starts at those poles and is fitted by Gauss and Newton with the noise as weight (maximum
likelihood), points eliminated one by one. Deviations follow from the scatter of the hits: each
deleted hit displaces H at its point, hence the estimate (delete-one jackknife, linearised); without
repeated hits from the residual of the fit.

Guillaume et al., Proc. 21st IMAC (2003), p-LSCF; El-Kafafy, Guillaume, Peeters, Mech. Syst. Signal
Process. 40 (2013) 463, the modal model by maximum likelihood; Efron and Stein, Ann. Stat. 9 (1981)
586, the jackknife; Pappa, Elliott, Schenk, J. Guid. Control Dyn. 16 (1993) 860, phase collinearity.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fem.correlation import mac
from fem.hits import FrequencyResponses


class Stability(NamedTuple):
    """When a pole is one of the order before, and when it is a mode."""

    largest_order: int = 24  # of A; not varied
    frequency: float = 0.005  # relative change of frequency from one order to the next
    damping: float = 0.3  # relative change of the damping ratio
    participation: float = 0.8  # MAC of participation factors
    share: float = 0.4  # of the orders above the first that a track must hold; not varied
    halves: float = 0.01  # relative difference of frequency between the halves of the hits
    largest_zeta: float = 0.15  # damping ratio above which a pole is part of the background
    iterations: int = 8  # of Gauss and Newton; 3 to 5 are usual
    least_share: float = 0.01  # of the response's energy at its own frequency that a mode carries


class StablePole(NamedTuple):
    """A pole followed over orders."""

    pole: complex  # [1/s]
    participation: NDArray[np.complex128]  # (m,)
    orders: tuple[int, ...]


class IdentifiedModes(NamedTuple):
    """Modes of a test, lowest first; deviations are one standard deviation."""

    frequency_hz: NDArray[np.float64]  # (n,) |lambda| / (2 pi)
    zeta: NDArray[np.float64]  # (n,)
    phi: NDArray[np.complex128]  # (p, n) the largest component is 1
    participation: NDArray[np.complex128]  # (n, m)
    frequency_deviation: NDArray[np.float64]  # (n,) [Hz]
    zeta_deviation: NDArray[np.float64]  # (n,)
    phi_deviation: NDArray[np.float64]  # (p, n) of the complex component
    collinearity: NDArray[np.float64]  # (n,) 1 for a real shape
    orders: NDArray[np.int64]  # (n,) in which the pole recurred
    diagram: list[tuple[int, NDArray[np.complex128]]]  # order, its decaying poles
    remarks: tuple[str, ...]  # poles that were dropped, and why


def phase_collinearity(phi: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Modal phase collinearity (n,) of shapes (p, n): 1 where all points move in phase or against,
    0 for a travelling wave. (Pappa, Elliott, Schenk 1993)"""
    x, y = phi.real, phi.imag
    xx, yy, xy = np.sum(x * x, axis=0), np.sum(y * y, axis=0), np.sum(x * y, axis=0)
    return ((xx - yy) ** 2 + 4 * xy**2) / np.maximum((xx + yy) ** 2, np.finfo(float).tiny)


def poles_of_orders(
    frequency_hz: NDArray[np.float64],
    H: NDArray[np.complex128],
    weight: NDArray[np.float64],
    orders: range,
) -> list[tuple[int, NDArray[np.complex128], NDArray[np.complex128]]]:
    """Order, decaying poles (k,) [1/s] with positive frequency, participation factors (k, m), for
    every order of A, of H (p, m, f) with weights (p, f)."""
    m = H.shape[1]
    top = orders[-1]
    dt = 0.5 / frequency_hz[-1]
    z = np.exp(-2j * np.pi * np.outer(frequency_hz * dt, np.arange(top + 1)))  # (f, top + 1)

    # Gram matrices of [B, A] of the largest order; those of lower orders are blocks of them
    R, S, T = [], [], np.zeros(((top + 1) * m, (top + 1) * m))
    for h, w in zip(H, weight, strict=True):
        X = w[:, None] * z
        Y = -(w[:, None, None] * z[:, :, None] * h.T[:, None, :]).reshape(len(z), -1)
        R.append((X.conj().T @ X).real)
        S.append((X.conj().T @ Y).real)
        T += (Y.conj().T @ Y).real

    result = []
    for order in orders:
        n = order + 1
        D = T[: n * m, : n * m].copy()
        for r, s in zip(R, S, strict=True):
            D -= s[:n, : n * m].T @ np.linalg.lstsq(r[:n, :n], s[:n, : n * m], rcond=1e-13)[0]
        # A_0 = 1, the others least squares; companion matrix of sum A_r z^r, for 1 / z
        A = -np.linalg.lstsq(D[m:, m:], D[m:, :m], rcond=1e-13)[0].reshape(order, m, m)
        companion = np.zeros((order * m, order * m))
        companion[:m] = np.concatenate([-a.T for a in A], axis=1)
        companion[m:, :-m] = np.eye((order - 1) * m)
        mu, V = np.linalg.eig(companion)
        usable = np.abs(mu) > 1e-12
        pole = np.log(mu[usable]) / dt
        L = V[:m, usable]
        keep = (pole.real < 0) & (pole.imag > 0)
        result.append((order, pole[keep], L[:, keep].T))
    return result


def stable_poles(
    diagram: list[tuple[int, NDArray[np.complex128], NDArray[np.complex128]]], options: Stability
) -> list[StablePole]:
    """Poles that recur from order to order, lowest frequency first: medians over the orders."""
    tracks: list[list[tuple[int, complex, NDArray[np.complex128]]]] = []
    for order, poles, L in diagram:
        light = (-poles.real < options.largest_zeta * np.abs(poles)).nonzero()[0]
        # one-to-one, the nearest pairs first; a track may miss two orders
        pairs = []
        for t, track in enumerate(tracks):
            last, pole, participation = track[-1]
            if order - last > 3:
                continue
            for j in light:
                change = abs(abs(poles[j]) / abs(pole) - 1) / options.frequency
                zetas = -poles[j].real / abs(poles[j]), -pole.real / abs(pole)
                damping = abs(zetas[0] - zetas[1]) / (max(zetas) * options.damping)
                similar = float(mac(L[j][:, None], participation[:, None])[0, 0])
                if change < 1 and damping < 1 and similar > options.participation:
                    pairs.append((change + damping + 1 - similar, t, int(j)))
        used_tracks, used_poles = set(), set()
        for _, t, j in sorted(pairs):
            if t not in used_tracks and j not in used_poles:
                tracks[t].append((order, complex(poles[j]), L[j]))
                used_tracks.add(t)
                used_poles.add(j)
        tracks += [[(order, complex(poles[j]), L[j])] for j in light if j not in used_poles]

    stable = []
    for track in tracks:
        if len(track) < options.share * len(diagram):
            continue
        orders, poles, L = zip(*track, strict=True)
        poles = np.array(poles)
        middle = complex(np.median(poles.real), np.median(poles.imag))
        stable.append(StablePole(middle, L[int(np.abs(poles - middle).argmin())], orders))
    return sorted(stable, key=lambda s: s.pole.imag)


def background(
    frequency_hz: NDArray[np.float64], even: int = 6, odd: int = 3
) -> NDArray[np.complex128]:
    """What modes outside of the band leave in it (1 + even + odd, f), with x = f over the largest:
    1 / x^2 of rigid motions and Chebyshev polynomials T(2 x^2 - 1), those times i x as well.

    A mode at 1.2 times the band's end is met to 3.5^(1 - even); with two even terms estimates of
    synthetic tests were up to eleven deviations off. Sampling, dt / (1 - exp((lambda - s) dt)) in
    place of 1 / (s - lambda), adds odd powers.
    """
    x = frequency_hz / frequency_hz[-1]
    smooth = np.polynomial.chebyshev.chebvander(2 * x**2 - 1, even - 1).T
    return np.concatenate([[(x[0] / x) ** 2], smooth, 1j * x * smooth[:odd]])


class ModalFit(NamedTuple):
    """The modal model at the responses (p, m, f), and what a change of H does to it."""

    pole: NDArray[np.complex128]  # (n,)
    L: NDArray[np.complex128]  # (n, m) the largest factor is 1
    phi: NDArray[np.complex128]  # (p, n)
    residual: NDArray[np.complex128]  # (p, m, f)
    normal: NDArray[np.float64]  # (g, g) of poles and factors, the points eliminated
    columns: list[NDArray[np.float64]]  # p of (rows, g + local): weighted derivatives
    n_global: int


def modal_fit(
    frequency_hz: NDArray[np.float64],
    H: NDArray[np.complex128],
    weight: NDArray[np.float64],
    poles: NDArray[np.complex128],
    L: NDArray[np.complex128],
    iterations: int,
) -> ModalFit:
    """Poles (n,), participation L (n, m) and shapes that fit H (p, m, f) by least squares with
    weights (p, m) [1 / standard deviation], by Gauss and Newton from the poles given."""
    m, f = H.shape[1:]
    n = len(poles)
    s = 2j * np.pi * frequency_hz
    low = np.kron(np.eye(m), background(frequency_hz))
    local_background = np.concatenate([low, 1j * low])
    L = L / L[np.arange(n), np.abs(L).argmax(axis=1)][:, None]
    free = np.abs(L - 1) > 0  # the factor that is 1 stays
    free[np.arange(n), np.abs(L).argmax(axis=1)] = False

    best = None
    damping_factor = 0.0
    step_poles, step_L = np.zeros(n, complex), np.zeros((n, m), complex)
    for _ in range(iterations + 1):
        at, L_at = poles + step_poles, L + step_L
        unstable = at.real >= 0
        at = np.where(unstable, -1e-4 * np.abs(at) + 1j * at.imag, at)
        P = 1 / (s - at[:, None])  # (n, f)
        Q = 1 / (s - at.conj()[:, None])
        plus = (L_at[:, :, None] * P[:, None]).reshape(n, m * f)
        minus = (L_at.conj()[:, :, None] * Q[:, None]).reshape(n, m * f)
        local = np.concatenate([plus + minus, 1j * (plus - minus), local_background])

        normal, gradient, phi, residual, columns, cost = 0.0, 0.0, [], [], [], 0.0
        for h, w in zip(H, weight, strict=True):
            scale = np.repeat(w, f)
            local_rows = stacked(local * scale).T
            target = stacked((h.reshape(-1) * scale)[None])[0]
            q, r = np.linalg.qr(local_rows)
            amplitudes = np.linalg.solve(r, q.T @ target)
            shape = amplitudes[:n] + 1j * amplitudes[n : 2 * n]
            misfit = target - local_rows @ amplitudes

            # derivatives for poles (real, imaginary) and for the free participation factors
            a = (shape[:, None, None] * L_at[:, :, None] * (P**2)[:, None]).reshape(n, m * f)
            b = (shape.conj()[:, None, None] * L_at.conj()[:, :, None] * (Q**2)[:, None]).reshape(
                n, m * f
            )
            rows = [a + b, 1j * (a - b)]
            for i, j in zip(*np.nonzero(free), strict=True):
                column = np.zeros((2, m, f), complex)
                one, two = shape[i] * P[i], shape[i].conj() * Q[i]
                column[0, j], column[1, j] = one + two, 1j * (one - two)
                rows.append(column.reshape(2, m * f))
            J = stacked(np.concatenate(rows) * scale).T
            projected = J - q @ (q.T @ J)
            normal = normal + projected.T @ projected
            gradient = gradient + projected.T @ misfit
            cost += float(misfit @ misfit)
            phi.append(shape)
            residual.append((misfit[: m * f] + 1j * misfit[m * f :]).reshape(m, f) / w[:, None])
            columns.append(np.concatenate([J, local_rows], axis=1))

        if best is None or cost < best[0]:
            settled = best is not None and best[0] - cost < 1e-4 * cost
            best = (
                cost,
                ModalFit(at, L_at, np.array(phi), np.array(residual), normal, columns, len(normal)),
                gradient,
            )
            poles, L = at, L_at
            damping_factor /= 10
            if settled:
                break
        else:  # the step was too long
            damping_factor = max(10 * damping_factor, 1e-3)
        _, fit, gradient = best
        scale = np.sqrt(np.maximum(np.diag(fit.normal), np.finfo(float).tiny))
        matrix = fit.normal / np.outer(scale, scale) + damping_factor * np.eye(len(scale))
        step = np.linalg.lstsq(matrix, gradient / scale, rcond=1e-12)[0] / scale
        step_poles = step[:n] + 1j * step[n : 2 * n]
        step_L = np.zeros((n, m), complex)
        pairs = step[2 * n :].reshape(-1, 2)
        step_L[free] = pairs[:, 0] + 1j * pairs[:, 1]
    return best[1]


def stacked(rows: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Real parts beside imaginary ones, (r, 2 k) of (r, k)."""
    return np.concatenate([rows.real, rows.imag], axis=1)


def identified_modes(
    test: FrequencyResponses,
    band_hz: tuple[float, float],
    options: Stability = Stability(),
) -> IdentifiedModes:
    """Modes of a test within a band [Hz].

    Raises ValueError where the band has too few lines, or no pole recurs.
    """
    within = (test.frequency_hz >= band_hz[0]) & (test.frequency_hz <= band_hz[1])
    within &= test.frequency_hz > 0
    f, H = test.frequency_hz[within], test.H[:, :, within]
    p, m, n_lines = H.shape
    # the lines must outnumber the coefficients, those of B included
    largest = min(options.largest_order, n_lines // 4)
    if largest < 8:
        raise ValueError(
            f"{n_lines} lines between {band_hz[0]:g} and {band_hz[1]:g} Hz; at least 32 are needed"
        )
    if not np.isfinite(H).all() or not H.any(axis=2).all():
        raise ValueError("a response is zero or no number between these frequencies; leave it out")

    # noise of every response: the scatter of its hits, else second differences along frequency
    # (second differences cancel what is smooth; of white noise they have six times its variance)
    noise = np.empty((p, m))
    for i, deleted in enumerate(test.deletions):
        if len(deleted):
            squares = (len(deleted) - 1) / len(deleted) * np.abs(deleted[:, :, within]) ** 2
            noise[i] = np.sqrt(np.median(squares.sum(axis=0), axis=1))
        else:
            curvature = np.abs(H[i, :, 2:] - 2 * H[i, :, 1:-1] + H[i, :, :-2])
            noise[i] = np.median(curvature, axis=1) / np.sqrt(6 * np.log(2))
    noise = np.maximum(noise, 1e-6 * np.abs(H).max(axis=2))
    if test.deletions and all(len(d) for d in test.deletions):
        noise = np.maximum(noise, 0.2 * np.median(noise))

    # stability over orders, then recurrence in both halves of the hits
    orders = range(2, largest + 1)
    weight = np.repeat(1 / np.sqrt(np.mean(noise**2, axis=1))[:, None], n_lines, axis=1)
    diagram = poles_of_orders(f, H, weight, orders)
    candidates, remarks = stable_poles(diagram, options), []
    if test.halves is not None:
        some = range(2, largest + 1, 3)
        recurring = [
            stable_poles(poles_of_orders(f, half[:, :, within], weight, some), options)
            for half in test.halves
        ]
        both = []
        for candidate in candidates:
            near = [
                any(abs(abs(s.pole) / abs(candidate.pole) - 1) < options.halves for s in half)
                for half in recurring
            ]
            if all(near):
                both.append(candidate)
            else:
                remarks.append(
                    f"{abs(candidate.pole) / (2 * np.pi):.2f} Hz is left out: it does not recur in "
                    "both halves of the hits"
                )
        candidates = both
    # the band's end is z = -1, where A has real roots that are no modes
    candidates = [c for c in candidates if f[0] <= c.pole.imag / (2 * np.pi) < 0.995 * f[-1]]
    if not candidates:
        raise ValueError("no pole recurs from order to order; measure with less noise or longer")

    # maximum likelihood, again without what carries no energy of its own
    while True:
        poles = np.array([c.pole for c in candidates])
        L = np.array([c.participation for c in candidates])
        fit = modal_fit(f, H, 1 / noise, poles, L, options.iterations)
        drop = None
        for i, pole in enumerate(fit.pole):
            line = int(np.abs(f - pole.imag / (2 * np.pi)).argmin())
            alone = np.outer(fit.phi[:, i], fit.L[i]) / (2j * np.pi * f[line] - pole)
            share = np.sum(np.abs(alone / noise) ** 2) / np.sum(np.abs(H[:, :, line] / noise) ** 2)
            moved = abs(abs(pole) / abs(poles[i]) - 1) > 2 * options.halves
            reason = None
            if moved or -pole.real > options.largest_zeta * abs(pole):
                reason = "the fit of the responses does not hold it there"
            elif share < options.least_share:
                reason = f"it carries {100 * share:.2g} % of the response at its frequency"
            if reason and (drop is None or share < drop[0]):
                drop = (share, i, reason)
        if drop is None:
            break
        _, i, reason = drop
        remarks.append(f"{abs(poles[i]) / (2 * np.pi):.2f} Hz is left out: {reason}")
        candidates.pop(i)
        if not candidates:
            raise ValueError("no pole that recurs carries energy of the responses")

    # displacement of poles, factors and shapes by each deleted hit, or by the noise of each line
    n, g = len(fit.pole), fit.n_global
    inverse = np.linalg.pinv(fit.normal, rcond=1e-13, hermitian=True)
    local_of_global, influences = [], []
    for i, columns in enumerate(fit.columns):
        J, local = columns[:, :g], columns[:, g:]
        q, r = np.linalg.qr(local)
        local_of_global.append(-np.linalg.solve(r, q.T @ J)[: 2 * n])
        deleted = test.deletions[i][:, :, within] if len(test.deletions[i]) else None
        if deleted is not None:
            rows = stacked((deleted / noise[i][:, None]).reshape(len(deleted), -1)).T
            rows = rows * np.sqrt((len(deleted) - 1) / len(deleted))
            projected = J - q @ (q.T @ J)
            influences.append((i, projected.T @ rows, np.linalg.solve(r, q.T @ rows)[: 2 * n]))
    if influences:
        displacement = np.concatenate([inverse @ gradient for _, gradient, _ in influences], axis=1)
        covariance = displacement @ displacement.T
    else:
        scatter = np.mean(np.abs(fit.residual / noise[:, :, None]) ** 2) / 2
        displacement, covariance = None, inverse * scatter
    pole_variance = np.array(
        [[covariance[i, i], covariance[n + i, n + i], covariance[i, n + i]] for i in range(n)]
    )

    phi_variance = np.zeros((p, n))
    for i, B in enumerate(local_of_global):
        if displacement is None:
            q, r = np.linalg.qr(fit.columns[i][:, g:])
            r_inverse = np.linalg.inv(r)
            local = (r_inverse @ r_inverse.T)[: 2 * n, : 2 * n] * scatter + B @ covariance @ B.T
            squares = np.diag(local)
        else:
            changes, start = B @ displacement, 0
            for j, gradient, direct in influences:
                if j == i:
                    changes[:, start : start + gradient.shape[1]] += direct
                start += gradient.shape[1]
            squares = np.sum(changes**2, axis=1)
        phi_variance[i] = squares[:n] + squares[n:]

    # the window's shift is taken off the poles; f = |lambda| / 2 pi, zeta = -Re lambda / |lambda|
    pole = fit.pole + test.shift
    size, sigma, omega = np.abs(pole), -pole.real, pole.imag
    rr, ii, ri = pole_variance.T
    size_variance = (sigma**2 * rr + omega**2 * ii - 2 * sigma * omega * ri) / size**2
    d_real, d_imag = -(omega**2) / size**3, sigma * -omega / size**3
    zeta_variance = d_real**2 * rr + d_imag**2 * ii + 2 * d_real * d_imag * ri
    largest_point = np.abs(fit.phi).argmax(axis=0)
    unit = fit.phi[largest_point, np.arange(n)]
    phi = fit.phi / unit
    order = np.argsort(size)
    recurred = np.array([len(c.orders) for c in candidates])
    return IdentifiedModes(
        (size / (2 * np.pi))[order], (sigma / size)[order], phi[:, order], fit.L[order],
        (np.sqrt(np.maximum(size_variance, 0)) / (2 * np.pi))[order],
        np.sqrt(np.maximum(zeta_variance, 0))[order],
        (np.sqrt(phi_variance) / np.abs(unit))[:, order],
        phase_collinearity(phi)[order], recurred[order],
        [(o, poles) for o, poles, _ in diagram], tuple(remarks),
    )  # fmt: skip
