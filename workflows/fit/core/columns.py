"""Columns of a record beside the model it starts from: turned signs and exchanged columns.

    c_ab(s) = sum_t y_a(t) m_b(t - s) / sqrt(sum_t y_a(t)^2  sum_t m_b(t - s)^2)

is the correlation of a column y_a with what the model shows of a sensor b, s later, over the time
that both have; both are changes within a while, so that plateaus and offsets have no say. A record
whose headings are right is as the model is at one delay s of all columns: the incident wave passes
them in order and pushes towards the wall, the reflected one comes back in reverse. It may begin
late: a first wave that is missing is no contradiction. What agrees clearly better with columns
exchanged or turned, and well, is refused; what agrees in no way is left to others to judge.
"""

from collections.abc import Iterator, Sequence
from itertools import combinations
from operator import attrgetter
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d
from scipy.signal import fftconvolve

from workflows.files.record import UnusableRecord

# The numbers below were tried on 1000 chains at random, see tests/test_coupling_columns.py.
WHILE = 4.0  # time within which changes are looked at, in time scales of the stiffest contact
COARSE = 0.4  # time between the samples that are compared, the same
STRETCHES = np.geomspace(0.75, 1.35, 16)  # of the model's time: other contacts
LATEST = 0.6  # of the record: how late the first touch may be, and how early before it
SHARED = 0.3  # least share of a column's and of a model's squares within the time that both have
REST = 0.2  # of the largest value: what a record may begin with beside the model
OTHER_SIGN = 0.2  # of the largest value: a wave that goes the other way
ARRIVED = 0.5  # of the largest value: the first wave has come
GOOD = 0.85  # correlation of columns that are not refused, whatever fits better
EARLIEST = 2.0  # time scales by which a record may begin after the touch and still show all


class Window(NamedTuple):
    """A part of a record, and what columns must be like in it to be refused. Of later waves a
    structure that is another than the model's makes others, of which a shorter part is free; a part
    with few waves agrees by chance with later ones of a model."""

    share: float  # of the record from its first wave on
    alike: float  # least correlation, in the mean of the columns
    better: float  # by which it must be above that of the columns as they are
    late: bool  # whether the record may have begun after the first touch


WINDOWS = Window(1.0, 0.7, 0.1, True), Window(0.5, 0.8, 0.2, False), Window(0.25, 0.8, 0.2, False)


class Correlations(NamedTuple):
    """c_ab (r, m, m, s) by stretch, column, sensor and delay."""

    by_delay: NDArray[np.float64]
    at_touch: int  # of the delays: the record begins with the first touch


class Fitting(NamedTuple):
    """Columns as they would have to be, and how well they then agree with the model."""

    order: tuple[int, ...]  # column that belongs under each heading
    sign: tuple[int, ...]  # of each column
    alike: float


ALIKE = attrgetter("alike")


def require_columns(
    names: Sequence[str],
    t: NDArray[np.float64],
    y: NDArray[np.float64],
    model: NDArray[np.float64],
    time_scale: float,
    *,
    signed: NDArray[np.bool_],
    forces: NDArray[np.bool_],
) -> None:
    """Raise UnusableRecord where columns y (k, m) are exchanged or turned.

    model (n, m) is what the scene shows at `beyond(t)` - t[0] since its first touch; `signed` (m,)
    are columns whose sign is known, unlike that of voltages with an unknown gain, `forces` (m,)
    those that are positive in incident and reflected waves alike. time_scale [s] is that of a
    contact.
    """
    dt = t[1] - t[0]
    begin, rest = (_begin(one, dt, time_scale) for one in (y, model))
    usual, *others = _arrangements(len(names), signed)
    others = [one for one in others if _begins(begin[list(one[0])], rest)]
    means = uniform_filter1d(y[:, ~forces], max(1, round(time_scale / dt)), axis=0, mode="nearest")
    if signed.all() and not _both_ways(means):  # one wave, that goes or that comes back
        others = [one for one in others if any(s > 0 for s in one[1])]
    from_start = np.abs(y - y[0])
    largest = np.maximum(from_start.max(axis=0), 1e-300)
    first = int((from_start > ARRIVED * largest).any(axis=1).argmax())
    for window in WINDOWS if others else ():
        k = first + int(window.share * (len(t) - first))
        C = _correlations(y[:k], model, dt, time_scale)
        if C is None:
            return
        as_they_are = _fitting(C.by_delay, *usual)
        late = 0 if window.late else max(C.at_touch - round(EARLIEST / COARSE), 0)
        best = max((_fitting(C.by_delay[..., late:], *one) for one in others), key=ALIKE)
        clear = best.alike > max(window.alike, as_they_are.alike + window.better)
        if clear and as_they_are.alike < GOOD:
            raise UnusableRecord(_refusal(names, best, as_they_are.alike))


def _refusal(names: Sequence[str], best: Fitting, as_they_are: float) -> str:
    said = f"(correlation with the model {best.alike:.2f}, as they are {as_they_are:.2f})"
    moved = [name for i, name in enumerate(names) if best.order[i] != i]
    turned = [name for i, name in enumerate(names) if best.sign[i] < 0]
    if moved:
        return (
            f"the columns {' and '.join(moved)} are swapped: the waves pass them in the other "
            f"order {said}; exchange their headings."
        )
    return (
        f"{' and '.join(turned)} {'has' if len(turned) == 1 else 'have'} the wrong sign: motions "
        f"go towards the wall and forces press where they are positive {said}; turn the sign of "
        f"the column{'s' * (len(turned) > 1)} or of the gain."
    )


def _both_ways(y: NDArray[np.float64]) -> bool:
    """Whether every signal (k, m) has waves of both signs."""
    high, low = y.max(axis=0), -y.min(axis=0)
    return bool((np.minimum(high, low) > OTHER_SIGN * np.maximum(high, low)).all())


def _begin(y: NDArray[np.float64], dt: float, time_scale: float) -> NDArray[np.float64]:
    """(m,) sizes that signals (k, m) begin with, over their largest."""
    first = y[: max(1, round(COARSE * time_scale / dt))].mean(axis=0)
    return np.abs(first) / np.maximum(np.abs(y).max(axis=0), 1e-300)


def _begins(begin: NDArray[np.float64], rest: NDArray[np.float64]) -> bool:
    """Whether a record begins as the model does, at rest but for a striker: one that begins within
    a wave has lost what tells the first wave from the next."""
    return bool((np.abs(begin - rest) < REST).all())


def _arrangements(m: int, signed) -> Iterator[tuple[tuple[int, ...], tuple[int, ...]]]:
    """Order and signs of m columns: as they are, two exchanged, one turned, all turned. A sign of 0
    is not known."""
    usual, own = tuple(range(m)), np.asarray(signed, int)
    yield usual, tuple(own)
    for i, j in combinations(usual, 2):
        order = list(usual)
        order[i], order[j] = j, i
        yield tuple(order), tuple(own)
    turned = [np.array([i]) for i in usual if own[i]]
    if own.sum() > 1:
        turned.append(np.flatnonzero(own))
    for which in turned:
        sign = own.copy()
        sign[which] *= -1
        yield usual, tuple(sign)


def _fitting(C: NDArray[np.float64], order, sign) -> Fitting:
    """The best stretch and delay of all columns together; C (r, m, m, s) by stretch, column, sensor
    and delay."""
    each = C[:, list(order), range(len(order))]
    known = np.array(sign)[:, None]
    alike = np.where(known == 0, np.abs(each), known * each).mean(axis=1)
    return Fitting(tuple(order), tuple(sign), float(alike.max()))


def _correlations(y, model, dt: float, time_scale: float) -> Correlations | None:
    """Of every column with every sensor; None of a record that is too short."""
    at, beyond = (np.arange(0.0, len(one) * dt, COARSE * time_scale) for one in (y, model))
    q = round(WHILE / COARSE)
    if len(at) < 4 * q:
        return None
    width = max(1, round(COARSE * time_scale / dt))
    data, shown = (uniform_filter1d(one, width, axis=0, mode="nearest") for one in (y, model))
    changes = _changes(at, dt, data, q)
    stretched = (_changes(beyond / factor, dt, shown, q) for factor in STRETCHES)
    by_delay = np.array([_by_delay(changes, one) for one in stretched])
    return Correlations(by_delay, min(int(LATEST * len(changes)), len(beyond) - q - 1))


def _by_delay(y: NDArray[np.float64], model: NDArray[np.float64]) -> NDArray[np.float64]:
    """c_ab (m, m, s) of y (k, m) with model (k, m). Before its first touch the model is at rest:
    whatever the data show there counts against it. What lies before the record, or beyond the end
    of the one or the other, does not count."""
    (k, m), n = y.shape, len(model)
    delay = np.arange(1 - n, k)
    first, last = np.maximum(-delay, 0), np.minimum(k - delay, n)  # of the model within the record
    of_data, of_model = (np.vstack([np.zeros(m), np.cumsum(one**2, axis=0)]) for one in (y, model))
    seen, shown = of_data[np.minimum(n + delay, k)], of_model[last] - of_model[first]
    enough = (shown > SHARED * of_model[-1]) & (of_model[-1] > 0.0)
    told = (seen > SHARED * of_data[-1]) & (of_data[-1] > 0.0)
    C = np.zeros((m, m, len(delay)))
    for a in range(m):
        for b in range(m):
            product = fftconvolve(y[:, a], model[::-1, b])  # from delay 1 - n to k - 1
            size = np.sqrt(seen[:, a] * shown[:, b])
            np.divide(product, size, out=C[a, b], where=enough[:, b] & told[:, a] & (size > 0))
    return C[..., np.abs(delay) <= LATEST * k]


def _changes(at, dt: float, y, q: int) -> NDArray[np.float64]:
    """(k, m) changes of samples y (.., m) within q of the times `at`."""
    t = dt * np.arange(len(y))
    there = np.array([np.interp(at, t, column) for column in y.T]).T
    return there[q:] - there[:-q]


def beyond(t: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n,) [s] times of a model that a record t (k,) may show from, however late it begins."""
    return t[0] + (t[1] - t[0]) * np.arange(round((1.0 + LATEST) * len(t)))
