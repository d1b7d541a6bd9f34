"""Frequency responses from the hits of a hammer test, with what spoils a hit found and named.

Of n hits at one point, with force spectra F and response spectra X,

    H1 = sum X F* / sum F F*,   H2 = sum X X* / sum F X*,   Hv = sqrt(H1 H2)

noise in the response leaves H1 unbiased, noise in the force H2. Records begin at the pulse: there
the discrete Fourier transform of a ring-down that is cut off at T is, at the lines of 1 / T, still

    sum R (1 - exp(lambda T)) / (i omega - lambda)

so that a record too short for the decay scales residues and moves no pole (no leakage). The
exponential window exp(-a t) on force and response shifts every pole by -a exactly, as it turns
x = h * f into (h w) * (f w); the shift is handed on with the responses.

Ewins, Modal Testing (2000), sec. 3.8 and 3.9; Rocklin, Crowley, Vold, Proc. 3rd IMAC (1985), of Hv.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

ESTIMATORS = ("H1", "H2", "Hv")


class Hits(NamedTuple):
    """Time records of n hits or ring-downs at k instants."""

    dt: float  # [s]
    force: NDArray[np.float64] | None  # (n, k) [N]; None for ring-downs
    response: NDArray[np.float64]  # (n, m, k) of m sensors
    point: NDArray[np.int64]  # (n,) which of the points was hit
    points: tuple[str, ...]  # their names, as "12+z" of node and direction
    sensors: tuple[str, ...]  # (m,)
    title: str
    quantity: str = ""  # "accelerations", "velocities" or "displacements" where it is known


class HitChecks(NamedTuple):
    """Limits of a usable hit, and the windows put on it."""

    second_impulse: float = (
        0.03  # of the impulse, in a later pulse: a double hit; 0.02 to 0.1 alike
    )
    flat: int = 4  # samples at exactly the largest magnitude: an overload; 2 or 3 may be chance
    opposite: float = 0.3  # of the peak, against it: no push; filters leave 0.05 to 0.1
    dead: float = 1.2  # energy over that of the record's end: nothing but noise is left
    noise: float = 6.0  # standard deviations above which a pulse stands clear of a force's noise
    force_width: float = 3.0  # pulse widths after the onset at which the force window ends
    decay: float | None = None  # exponential window at the record's end; None: no window


# Lines at which a force spectrum holds too little to divide by
NULL_FORCE = 0.01  # of the largest: below, rounding and noise are divided by nothing
# of the largest, below which a line needs coherence (hammers are used down to a tenth, 20 dB:
# ISO 7626-5). With 0.02 a pole near the null of a pulse of five samples was listed as a mode where
# the noise was 0.5 %
WEAK_FORCE = 0.1
WEAK_FORCE_OF_SINGLE_HIT = 0.05  # which has no coherence
MIN_COHERENCE = 0.8  # median of the responses and of N_SMOOTHED_LINES
N_SMOOTHED_LINES = 9
MAX_LISTED_RANGES = 3  # ranges that a sentence names


class Deletions(NamedTuple):
    """H without each of n hits, less H, at the points (a,) and references (b,) that they reach."""

    points: NDArray[np.int64]  # (a,)
    references: NDArray[np.int64]  # (b,)
    change: NDArray[np.complex128]  # (n, a, b, f)


class FrequencyResponses(NamedTuple):
    """Responses of p points and m references at f lines: points are those hit and references the
    sensors, or the reverse; of ring-downs points are the sensors and references the records, and H
    has the unit of the record times seconds."""

    frequency_hz: NDArray[np.float64]  # (f,)
    H: NDArray[np.complex128]  # (p, m, f)
    points: tuple[str, ...]  # (p,)
    references: tuple[str, ...]  # (m,)
    coherence: NDArray[np.float64] | None = None  # (p, m, f); None where no point has two hits
    deletions: tuple[Deletions, ...] = ()  # of the points hit more than once
    halves: NDArray[np.complex128] | None = None  # (2, p, m, f) of every other hit
    shift: float = 0.0  # [1/s] by which the exponential window has moved every pole to the left
    remarks: tuple[str, ...] = ()  # hits left out, and why
    excited: NDArray[np.bool_] | None = None  # (f,) lines that the force holds; None: all

    @property
    def usable(self) -> NDArray[np.bool_]:
        """Lines (f,) that a fit may read: those that the force excites."""
        return np.ones(len(self.frequency_hz), bool) if self.excited is None else self.excited

    def transposed(self) -> "FrequencyResponses":
        """Points as references and references as points: the same by reciprocity."""
        return self._replace(
            H=self.H.swapaxes(0, 1), points=self.references, references=self.points,
            coherence=None if self.coherence is None else self.coherence.swapaxes(0, 1),
            deletions=tuple(
                Deletions(d.references, d.points, d.change.swapaxes(1, 2)) for d in self.deletions
            ),
            halves=None if self.halves is None else self.halves.swapaxes(1, 2),
        )  # fmt: skip


def beside(first: FrequencyResponses, second: FrequencyResponses) -> FrequencyResponses:
    """Responses of the same points to the references of both: of sensors that were moved.

    Raises ValueError where points or lines differ.
    """
    if {*first.points} != {*second.points}:
        alone = sorted({*first.points} ^ {*second.points})
        raise ValueError(f"{alone[0]} was hit with some of the sensors only; hit it with all")
    if not np.array_equal(first.frequency_hz, second.frequency_hz):
        raise ValueError("the records differ in length or sampling; write them alike")
    order = [second.points.index(name) for name in first.points]
    place = {old: new for new, old in enumerate(order)}
    moved = tuple(
        Deletions(
            np.array([place[i] for i in d.points.tolist()]),
            d.references + len(first.references), d.change,
        )
        for d in second.deletions
    )  # fmt: skip
    halves, coherence = None, None
    if first.halves is not None and second.halves is not None:
        halves = np.concatenate([first.halves, second.halves[:, order]], axis=2)
    if first.coherence is not None and second.coherence is not None:
        coherence = np.concatenate([first.coherence, second.coherence[order]], axis=1)
    return first._replace(
        H=np.concatenate([first.H, second.H[order]], axis=1),
        references=first.references + second.references,
        coherence=coherence, deletions=first.deletions + moved, halves=halves,
        remarks=tuple(dict.fromkeys(first.remarks + second.remarks)),
        excited=first.usable & second.usable,
    )  # fmt: skip


def frequency_responses(
    hits: Hits,
    estimator: str = "H1",
    checks: HitChecks = HitChecks(),
    *,
    samples: int | None = None,
) -> FrequencyResponses:
    """Frequency responses of the hits that are usable, of at most `samples` from each onset: H
    (p, m, f) of the p points hit, m sensors and f lines of 1 / T from 0 Hz on; records without a
    force give spectra (`ring_down_spectra`).

    Raises ValueError where no hit is usable, for an unknown estimator, and for records with NaN.
    """
    if estimator not in ESTIMATORS:
        raise ValueError(f"estimator {estimator!r} must be one of {', '.join(ESTIMATORS)}")
    if not np.isfinite(hits.response).all() or not (
        hits.force is None or np.isfinite(hits.force).all()
    ):
        raise ValueError("the records hold NaN or inf; remove those hits or measure again")
    if hits.force is None:
        return ring_down_spectra(hits, checks)

    # onset and width of every pulse, and why a hit is left out
    n, k = hits.force.shape
    usable, onset, width, remarks = np.ones(n, bool), np.zeros(n, int), np.ones(n, int), []
    sign = np.sign(hits.force[np.arange(n), np.abs(hits.force).argmax(axis=1)])
    for i, f in enumerate(hits.force * sign[:, None]):
        # noise by the median of deviations, 1.4826 times which is a Gaussian's standard deviation:
        # the pulse itself does not count
        peak = int(f.argmax())
        noise = 1.4826 * np.median(np.abs(f - np.median(f)))
        reason = None
        if f[peak] <= 0 or f[peak] < checks.noise * noise:
            reason = "no pulse in the force"
        elif peak > 0.9 * k:
            reason = "the pulse comes at the record's end: the trigger is late"
        # from where the force last lies in the noise before its peak to where it first does behind
        if reason is None:
            low = np.flatnonzero(f[:peak] < max(0.02 * f[peak], 3 * noise))
            high = np.flatnonzero(f[peak:] < max(0.02 * f[peak], 3 * noise))
            onset[i] = low[-1] if len(low) else 0
            end = peak + (high[0] if len(high) else k - peak)
            width[i] = end - onset[i]
            reason = hit_defect(f, onset[i], width[i], noise, hits.response[i], checks)
        if reason:
            usable[i] = False
            name = hits.points[hits.point[i]]
            remarks.append(f"hit {i + 1} at {name} is left out: {reason}")
    if not usable.any():
        raise ValueError(f"no hit is usable ({remarks[0]})")

    # records from the onset on, all of one length, the force cleared of noise behind its pulse
    used = np.flatnonzero(usable)
    length = min(int(k - onset[used].max()), samples or k)
    responses = [hits.response[i, :, onset[i] : onset[i] + length] for i in used]
    length = until_noise(responses, checks.dead)

    # exponential window exp(-a t), and one on the force that ends behind its pulse with a slope: a
    # step there would spread over the spectrum
    ramp = np.arange(length)
    a = 0.0 if checks.decay is None else -np.log(checks.decay) / (length * hits.dt)
    decay = np.exp(-a * hits.dt * ramp)
    F, X = [], []
    for i in used:
        end = checks.force_width * width[i]
        window = np.clip(1 - (ramp - end) / max(end / 4, 1.0), 0, 1)
        F.append(np.fft.rfft(hits.force[i, onset[i] : onset[i] + length] * window * decay))
        X.append(np.fft.rfft(hits.response[i, :, onset[i] : onset[i] + length] * decay))
    F, X = np.array(F), np.array(X)

    # point by point: H of all hits, of all but one, and of every other one
    points = np.unique(hits.point[used])
    remarks += [
        f"{hits.points[i]} has no usable hit" for i in np.setdiff1d(hits.point, points).tolist()
    ]
    H, coherence, deletions, halves = [], [], [], []
    share = np.inf  # of the force spectrum in its largest value, of the point that has least
    for i, point in enumerate(points):
        rows = np.flatnonzero(hits.point[used] == point)
        f, x = F[rows], X[rows]
        response, squared_coherence = estimate(f, x, estimator)
        size = np.sqrt(np.sum(np.abs(f) ** 2, axis=0))
        share = np.minimum(share, size / size.max())
        H.append(response)
        coherence.append(squared_coherence)
        if len(rows) > 1:
            without_one = [np.arange(len(rows)) != h for h in range(len(rows))]
            change = [estimate(f[w], x[w], estimator)[0] - response for w in without_one]
            sensors = np.arange(len(hits.sensors))
            deletions.append(Deletions(np.array([i]), sensors, np.array(change)[:, None]))
            halves.append([estimate(f[h::2], x[h::2], estimator)[0] for h in (0, 1)])
        else:
            halves.append([response, response])

    # lines that the force does not excite
    frequency_hz = np.arange(F.shape[1]) / (length * hits.dt)
    excited = excited_lines(share, np.array(coherence) if deletions else None)
    return FrequencyResponses(
        frequency_hz, np.array(H),
        tuple(hits.points[point] for point in points), hits.sensors,
        np.array(coherence) if deletions else None, tuple(deletions),
        np.array(halves).swapaxes(0, 1) if deletions else None, float(a), tuple(remarks), excited,
    )  # fmt: skip


def excited_lines(
    share: NDArray[np.float64],
    coherence: NDArray[np.float64] | None,
) -> NDArray[np.bool_]:
    """Lines (f,) at which the force is known: `share` (f,) is its spectrum over the largest value,
    coherence (p, m, f) that of the responses, None of single hits.

    A pulse of length T has a spectrum with zeros from about 1.5 / T on: there H is noise over
    nothing, in which a fit finds sharp modes.
    """
    if coherence is None:
        return share >= WEAK_FORCE_OF_SINGLE_HIT
    # of pure noise and few hits single lines may be coherent by chance: a median along lines
    median = median_filter(np.median(coherence, axis=(0, 1)), N_SMOOTHED_LINES, mode="nearest")
    is_null = share < NULL_FORCE
    return ~is_null & ((share >= WEAK_FORCE) | (median >= MIN_COHERENCE))


def lines_left_out(
    frequency_hz: NDArray[np.float64],
    excited: NDArray[np.bool_],
) -> list[str]:
    """A sentence on the ranges of lines that are not excited; none where all are."""
    at = np.flatnonzero(~excited)
    if not at.size:
        return []
    ranges = np.split(at, np.flatnonzero(np.diff(at) > 1) + 1)
    ranges.sort(key=len, reverse=True)
    named = sorted(ranges[:MAX_LISTED_RANGES], key=lambda r: r[0])
    listed = ", ".join(
        f"{frequency_hz[r[0]]:.5g}" + (f" to {frequency_hz[r[-1]]:.5g} Hz" if len(r) > 1 else " Hz")
        for r in named
    )
    more = len(ranges) - len(named)
    further = f" and {more} smaller ranges" if more else ""
    return [
        f"{len(at)} lines of {len(excited)} are left out, where the force hardly excites: "
        f"{listed}{further}"
    ]


def until_noise(responses: list[NDArray[np.float64]], dead: float, shortest: int = 1024) -> int:
    """Samples of responses (m, k), one array a hit, that are worth a transform: halved as long as
    what follows the first quarter is noise, whose energy is up to `dead` times that of the last
    quarter. Never below `shortest` samples: of noise alone too few lines would be left."""
    length = responses[0].shape[1]
    while length >= 2 * shortest:
        block = length // 16
        energy = sum(
            np.sum(x[:, : 16 * block].reshape(len(x), 16, block) ** 2, axis=(0, 2), dtype=float)
            / max(float(np.mean(x[:, 12 * block : length] ** 2, dtype=float)), 1e-300)
            for x in responses
        )
        if energy[4:].max() > dead * energy[12:].mean():
            break
        length //= 2
    return length


def hit_defect(
    force: NDArray[np.float64],
    onset: int,
    width: int,
    noise: float,
    response: NDArray[np.float64],
    checks: HitChecks,
) -> str | None:
    """Reason why a hit cannot be used: an overload, a double hit, a force that rings; else None.

    force (k,) is positive at its peak; onset and width of its pulse are in samples, noise is the
    standard deviation of its noise; response (m, k).
    """
    for name, record in (("force", force[None]), ("response", response)):
        for row in np.abs(record):
            if np.count_nonzero(row >= row.max() * (1 - 1e-9)) >= checks.flat and row.any():
                return f"overload of the {name}"

    if -force.min() > max(checks.opposite * force.max(), checks.noise * noise):
        return "the force changes its sign: force and response are swapped, or it is no hammer's"

    # sums over windows as wide as the pulse, behind it; those of noise grow with sqrt(width)
    impulse = force[onset : onset + width].sum()
    behind = np.convolve(force[onset + width :], np.ones(width), "valid")
    least = max(checks.second_impulse * impulse, checks.noise * noise * np.sqrt(width))
    if behind.size and np.count_nonzero(np.abs(behind) > least) > behind.size / 10:
        return "the force rings on: force and response are swapped, or the force has an offset"
    if behind.size and behind.max() > least:
        return f"double hit, {width + int(np.argmax(behind > least))} samples behind the first"
    return None


def estimate(
    F: NDArray[np.complex128], X: NDArray[np.complex128], estimator: str
) -> tuple[NDArray[np.complex128], NDArray[np.float64]]:
    """H (m, f) and coherence (m, f) of n hits with spectra F (n, f) and X (n, m, f), as the module
    has H1, H2 and Hv; the coherence |S_xf|^2 / (S_ff S_xx) is 1 of a single hit."""
    S_ff = np.sum(np.abs(F) ** 2, axis=0)
    S_xx = np.sum(np.abs(X) ** 2, axis=0)
    S_xf = np.sum(X * F.conj()[:, None], axis=0)
    tiny = np.finfo(float).tiny
    coherence = np.abs(S_xf) ** 2 / np.maximum(S_ff * S_xx, tiny)
    H1 = S_xf / np.maximum(S_ff, tiny)
    if estimator == "H1":
        return H1, coherence
    ratio = 1 / np.maximum(coherence, tiny)  # H2 / H1
    return H1 * (ratio if estimator == "H2" else np.sqrt(ratio)), coherence


def ring_down_spectra(hits: Hits, checks: HitChecks) -> FrequencyResponses:
    """Spectra of ring-downs from their largest sample on, sensors as points, records as references.

    A free decay is sum phi_i c_i exp(lambda_i t): its transform has the poles of a frequency
    response, and what each record excites takes the place of the participation of a reference.
    Raises ValueError where no record is usable: each is zero, overloaded or rises too late.
    """
    # a record is usable where it begins with its decay and no sensor is overloaded; which sample is
    # the largest is judged sensor by sensor, since their units may differ
    k = hits.response.shape[2]
    usable, remarks = [], []
    for i, x in enumerate(hits.response):
        size = np.abs(x) / np.maximum(np.abs(x).max(axis=1, keepdims=True), np.finfo(float).tiny)
        top = int(size.max(axis=0).argmax())
        at_top = np.count_nonzero(size > 1 - 1e-9, axis=1)
        if not x.any():
            remarks.append(f"record {i + 1} is left out: it is zero")
        elif at_top.max() >= checks.flat:
            remarks.append(f"record {i + 1} is left out: overload")
        elif top > 0.5 * k:
            remarks.append(f"record {i + 1} is left out: its largest sample is in its second half")
        else:
            usable.append((i, top))
    if not usable:
        raise ValueError(f"no record is usable ({remarks[0]})")

    # all of one length, under the exponential window exp(-a t), which shifts every pole by -a
    length = k - max(top for _, top in usable)
    a = 0.0 if checks.decay is None else -np.log(checks.decay) / (length * hits.dt)
    decay = np.exp(-a * hits.dt * np.arange(length))
    X = np.array([np.fft.rfft(hits.response[i, :, t : t + length] * decay) for i, t in usable])
    H = hits.dt * X.swapaxes(0, 1)
    return FrequencyResponses(
        np.arange(H.shape[2]) / (length * hits.dt), H, hits.sensors,
        tuple(f"record {i + 1}" for i, _ in usable), shift=float(a), remarks=tuple(remarks),
    )  # fmt: skip
