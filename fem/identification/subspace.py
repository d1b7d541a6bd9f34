"""Modes of records without a force: covariance-driven stochastic subspace identification (SSI-cov).

Correlations R_k = E[y(t + k) y(t)^T] of a structure that white noise drives, and those of a free
decay, are C A^(k-1) G with the state matrix A of time step dt. Stacked as

    H = [R_1 R_2 ..; R_2 R_3 ..; ..] = O Gamma,   O = [C; C A; ..],

the singular value decomposition H = U S V^T gives O = U_n S_n^(1/2) at order n, A from the shift
O_up A = O_down, the poles ln(mu) / dt of its eigenvalues mu and the shapes C psi of its vectors.

Deviations: R is a mean over blocks of the record (records, of ring-downs); the estimate is repeated
without each of them (delete-one jackknife).

Peeters and De Roeck, Mech. Syst. Signal Process. 13 (1999) 855; Efron and Stein, Ann. Stat. 9
(1981) 586.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, next_fast_len, rfft

from beadwave.fem.identification.poly_reference import (
    IdentifiedModes,
    Stability,
    StablePole,
    of_pole,
    phase_collinearity,
    stable_poles,
)
from beadwave.fem.modes.mac import mac

# Lags, orders and blocks
N_BLOCKS = 20  # of an ambient record; 10 to 40 give the same deviations within their scatter
MAX_ROWS = 400  # rows of H, at most
N_PERIODS = 3.0  # of the lowest frequency within the lags, as far as the rows allow
OVERSAMPLING = 2.56  # of the sampling rate over the band's upper end
MAX_ORDER = 60
OUTLIER_CHANGE = 0.1  # relative change of a frequency by one block that is another pole
TWIN_DISTANCE = 0.015  # relative distance of two tracks of one mode
TWIN_MAC = 0.9  # MAC of their shapes


def correlations(y: NDArray[np.float64], n_lags: int) -> NDArray[np.float64]:
    """R_1 to R_n_lags (n_lags, m, m), in the square of the record's unit, of a record (m, k), all
    from the same count of instants: with fewer at longer lags their scatter would differ."""
    k = y.shape[1] - n_lags
    now = y[:, :k].T / k
    return np.array([y[:, lag : lag + k] @ now for lag in range(1, n_lags + 1)])


def subspace_poles(
    R: NDArray[np.float64], dt: float, orders: range | tuple[int, ...]
) -> list[tuple[int, NDArray[np.complex128], NDArray[np.complex128]]]:
    """Order, decaying poles (k,) [1/s] of positive frequency and their shapes (k, m), of
    correlations R (2 s, m, m) at lags dt [s], 2 dt, ...; orders up to (s - 1) m.

    One singular value decomposition of H (s m, s m) serves all orders: its first n vectors are
    those of order n.
    """
    s, m = len(R) // 2, R.shape[1]
    H = np.block([[R[i + j] for j in range(s)] for i in range(s)])
    U, S, _ = np.linalg.svd(H)
    result = []
    for order in orders:
        O = U[:, :order] * np.sqrt(S[:order])
        A = np.linalg.lstsq(O[:-m], O[m:], rcond=None)[0]
        mu, psi = np.linalg.eig(A)
        pole = np.log(np.where(mu == 0, 1e-300, mu).astype(complex)) / dt
        keep = (pole.real < 0) & (pole.imag > 0)
        result.append((order, pole[keep], (O[:m] @ psi)[:, keep].T))
    return result


def blocks_of(
    records: list[NDArray[np.float64]], dt: float, band_hz: tuple[float, float]
) -> tuple[list[NDArray[np.float64]], float, int]:
    """Records (m, k) at a step [s] whose frequencies the band fills, a single one cut into blocks;
    that step; and s, block rows and columns of H, for lags up to 2 s. Raises ValueError for records
    shorter than 4 s samples."""
    from scipy.signal import decimate

    # decimated by a filter of linear phase, which moves no pole, in steps of ten at most
    factor = int(0.5 / dt / (0.5 * OVERSAMPLING * band_hz[1]))
    while factor > 1:
        step = min(factor, 10)
        records = [decimate(y, step, ftype="fir", axis=1) for y in records]
        dt, factor = dt * step, factor // step

    # lags over some periods of the lowest mode, but enough rows for the largest order
    records = [y - y.mean(axis=1, keepdims=True) for y in records]
    m = len(records[0])
    s = min(int(N_PERIODS / (band_hz[0] * dt)), MAX_ROWS // m)
    s = max(s, -(-MAX_ORDER // m) + 1)
    if len(records) == 1:
        k = records[0].shape[1] // N_BLOCKS
        records = [records[0][:, i * k : (i + 1) * k] for i in range(N_BLOCKS)]
    shortest = min(y.shape[1] for y in records)
    if shortest < 4 * s:
        raise ValueError(
            f"{shortest} samples a block at {1 / dt:.4g} Hz; {4 * s} are needed: record longer, or "
            "identify from a higher frequency on"
        )
    return records, dt, s


def subspace_modes(
    records: list[NDArray[np.float64]],
    dt: float,
    band_hz: tuple[float, float],
    stability: Stability = Stability(),
    *,
    reject: tuple[int, ...] = (),
    accept: tuple[int, ...] = (),
) -> IdentifiedModes:
    """Modes within a band [Hz] of records (m, k): several ring-downs, or one of ambient vibration.

    They have no participation of references. Poles that recur are numbered from 1 before any is
    left out, see `identified_modes`. Raises ValueError for records too short, where no pole recurs,
    and for numbers that are none.
    """
    records, dt, s = blocks_of(records, dt, band_hz)
    m = len(records[0])
    lags = np.array([correlations(y, 2 * s) for y in records])
    mean, n = lags.mean(axis=0), len(lags)

    # poles that recur over orders, and in every other block
    orders = range(4, min(MAX_ORDER, (s - 1) * m) + 1, 2)
    diagram = subspace_poles(mean, dt, orders)
    within = [
        pole for pole in stable_poles(diagram, stability)
        if band_hz[0] <= abs(pole.pole) / (2 * np.pi) <= band_hz[1]
    ]  # fmt: skip
    if not within:
        raise ValueError("no pole recurs from order to order; record longer")
    for number in (*reject, *accept):
        if not 1 <= number <= len(within):
            raise ValueError(f"pole {number} is none: they are numbered 1 to {len(within)}")

    # a mode recurs in either half of the blocks; of fewer than four a half would be one record
    halves = []
    if n > 3:
        halves = [
            stable_poles(subspace_poles(lags[h::2].mean(axis=0), dt, orders), stability)
            for h in (0, 1)
        ]
    chosen: list[tuple[int, StablePole]] = []
    left_out = []
    for number, pole in enumerate(within, start=1):
        recurs = all(
            any(abs(abs(p.pole) / abs(pole.pole) - 1) < stability.halves for p in half)
            for half in halves
        )
        # a second track of one mode: of the two the one of more orders
        twins = [
            other for other in within
            if other is not pole
            and abs(abs(other.pole) / abs(pole.pole) - 1) < TWIN_DISTANCE
            and mac(other.participation[:, None], pole.participation[:, None])[0, 0] > TWIN_MAC
            and (len(other.orders), abs(other.pole)) > (len(pole.orders), abs(pole.pole))
        ]  # fmt: skip
        reason = None
        if number in reject:
            reason = "rejected"
        elif number not in accept and twins:
            reason = f"it is a double of {abs(twins[0].pole) / (2 * np.pi):.2f} Hz"
        elif number not in accept and not recurs:
            reason = "it does not recur in both halves of the record"
        if reason:
            left_out.append(of_pole(number, pole.pole, reason))
        else:
            chosen.append((number, pole))
    if not chosen:
        raise ValueError("no pole recurs in both halves of the record; record longer")

    # each at the order whose estimate is nearest to the median, then without each block there
    own_order = []
    poles, shapes = [], []
    for _, candidate in chosen:
        at = [
            (abs(p - candidate.pole), order, p, phi)
            for order, some, L in diagram if order in candidate.orders
            for p, phi in zip(some, L, strict=True)
        ]  # fmt: skip
        _, order, pole, phi = min(at, key=lambda row: row[0])
        own_order.append(order)
        poles.append(pole)
        shapes.append(phi)
    poles, phi = np.array(poles), np.array(shapes).T
    unit = np.abs(phi).argmax(axis=0)
    phi = phi / phi[unit, np.arange(len(poles))]
    deleted, deleted_phi = without_each_block(lags, dt, own_order, poles, phi, unit)

    order = np.argsort(np.abs(poles))
    size = np.abs(deleted)
    return IdentifiedModes(
        np.array([number for number, _ in chosen])[order],
        (np.abs(poles) / (2 * np.pi))[order], (-poles.real / np.abs(poles))[order], phi[:, order],
        np.empty((len(poles), 0), complex), jackknife(size / (2 * np.pi))[order],
        jackknife(-deleted.real / size)[order], jackknife(deleted_phi)[:, order],
        phase_collinearity(phi)[order],
        np.array([len(pole.orders) for _, pole in chosen])[order], tuple(left_out),
        tuple((o, p) for o, p, _ in diagram), (),
    )  # fmt: skip


def without_each_block(
    lags: NDArray[np.float64],
    dt: float,
    own_order: list[int],
    poles: NDArray[np.complex128],
    phi: NDArray[np.complex128],
    unit: NDArray[np.int64],
) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
    """Poles (n, k) and shapes (n, m, k), 1 at the points `unit` (k,), without each of n blocks,
    each at the order of its own; nan where no pole is near."""
    n, mean = len(lags), lags.mean(axis=0)
    deleted = np.full((n, len(poles)), np.nan, complex)
    deleted_phi = np.full((n, *phi.shape), np.nan, complex)
    for b in range(n if n > 1 else 0):
        remaining_lags = (n * mean - lags[b]) / (n - 1)
        by_order = {
            o: (p, L) for o, p, L in subspace_poles(remaining_lags, dt, tuple({*own_order}))
        }
        for i, order in enumerate(own_order):
            some, L = by_order[order]
            if not len(some):
                continue
            alike = mac(L.T, phi[:, [i]])[:, 0]
            j = int((np.abs(some / poles[i] - 1) + 0.1 * (1 - alike)).argmin())
            if abs(some[j] / poles[i] - 1) < OUTLIER_CHANGE:
                deleted[b, i], deleted_phi[b, :, i] = some[j], L[j] / L[j, unit[i]]
    return deleted, deleted_phi


def jackknife(values: NDArray) -> NDArray[np.float64]:
    """Standard deviation (...) by n estimates without one block each, values (n, ...), real or
    complex: sqrt((n - 1) / c sum |v - mean|^2) over the c of them that have the pole, others being
    nan; nan where half of them or more lost it."""
    n = len(values)
    count = np.sum(np.isfinite(values), axis=0)
    middle = np.nansum(values, axis=0) / np.maximum(count, 1)
    squares = np.nansum(np.abs(values - middle) ** 2, axis=0)
    spread = np.sqrt((n - 1) / np.maximum(count, 1) * squares)
    return np.where(count > max(n / 2, 1), spread, np.nan)


def is_decay(y: NDArray[np.float64], factor: float = 4.0) -> bool:
    """True if a record (m, k) is a ring-down: its energy falls by `factor` from its first to its
    second half, where that of ambient vibration is the same but for chance."""
    half = y.shape[1] // 2
    centred = y - y.mean(axis=1, keepdims=True)
    first, second = (np.sum(part**2) for part in (centred[:, :half], centred[:, half:]))
    return bool(first > factor * second)


def half_spectra(
    records: list[NDArray[np.float64]], dt: float, lines: int = 2000
) -> tuple[NDArray[np.float64], NDArray[np.complex128], float]:
    """Frequencies (lines,) [Hz], transforms (m, m, lines) of the correlations at positive lags, and
    the shift [1/s] of their poles by an exponential window: they have the poles of responses, and
    are for looking at. lines is the largest number of them; records are (m, k) each."""
    # correlations by the product of spectra, with zeros behind the record so that its end does not
    # meet its beginning
    n_lags = min(2 * (lines - 1), min(y.shape[1] for y in records) // 4)
    m = len(records[0])
    R = np.zeros((n_lags, m, m))
    for y in records:
        k = y.shape[1]
        Y = [rfft(row - row.mean(), next_fast_len(k + n_lags)) for row in y]
        for i in range(m):
            for j in range(m):
                R[:, i, j] += irfft(Y[i] * Y[j].conj())[:n_lags] / (k * len(records))
    shift = -np.log(0.01) / (n_lags * dt)
    window = np.exp(-shift * dt * np.arange(n_lags))[:, None, None]
    H = np.fft.rfft(R * window, axis=0).transpose(1, 2, 0) * dt
    return np.fft.rfftfreq(n_lags, dt), H, float(shift)
