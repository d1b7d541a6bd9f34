"""Columns of a record against the model it starts from: turned signs and exchanged columns.

    c_ab(s) = sum_t y_a(t) m_b(t - s) / sqrt(sum_t y_a(t)^2  sum_t m_b(t - s)^2)

is the correlation of a column y_a with what the model shows of a sensor b, s later, over the time
that both have; both are changes over a few time scales of a contact, so that plateaus and offsets
do not count. A record whose headings are right is as the model is at one delay s of all columns:
the incident wave passes them in order and pushes towards the wall, the reflected one comes back in
reverse. It may begin late: a first wave that is missing is no contradiction. What agrees clearly
better with columns exchanged or turned, and well, is refused; what agrees in no way is left to
others to judge.
"""

from collections.abc import Iterator, Sequence
from itertools import combinations
from operator import itemgetter
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d
from scipy.signal import fftconvolve

from beadwave.workflows.files.record import UnusableRecord


class RecordWindow(NamedTuple):
    """A part of a record, and what columns must be like in it to be refused. Of later waves a
    structure that is another than the model's makes others, of which a shorter part is free; a part
    with few waves agrees by chance with later ones of a model."""

    share: float  # of the record from its first wave on
    least: float  # correlation that refuses, at least, in the mean of the columns
    better: float  # by which it must be above that of the columns as they are
    late: bool  # whether the record may have begun after the first touch


# Numbers of the test, tried on 1000 chains at random: see tests/fit/test_columns.py. A time
# scale is that of the stiffest contact.
WINDOWS = (
    RecordWindow(1.0, 0.7, 0.1, True),
    RecordWindow(0.5, 0.8, 0.2, False),
    RecordWindow(0.25, 0.8, 0.2, False),
)
LAG = 4.0  # time scales over which changes are taken
SAMPLING = 0.4  # time scales between the samples that are compared
STRETCHES = tuple(np.geomspace(0.75, 1.35, 16))  # of the model's time
LATEST_TOUCH = 0.6  # of the record: how late the first touch may be, and how early before it
MIN_SHARED = 0.3  # least share of a signal's squares within the time that both have
REST_DIFFERENCE = 0.2  # of the largest value: by how much a record may begin unlike the model
OTHER_SIGN = 0.2  # of the largest value: a wave that goes the other way
ARRIVED = 0.5  # of the largest value: the first wave has come
GOOD_CORRELATION = 0.85  # correlation of columns that are not refused, whatever fits better
EARLIEST_BEGIN = 2.0  # time scales after the touch at which a record that shows all may begin


class Arrangement(NamedTuple):
    """Columns as they would have to be."""

    order: tuple[int, ...]  # column that belongs under each heading
    sign: tuple[int, ...]  # of each column; 0 is not known


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

    model (n, m) is what the scene shows at `model_times(t)` - t[0] since its first touch; `signed`
    (m,) are columns whose sign is known, unlike that of voltages with an unknown gain; `forces`
    (m,) those that are positive in incident and reflected waves alike. time_scale [s] is that of a
    contact.
    """
    dt = t[1] - t[0]
    as_they_are, *others = _arrangements(len(names), signed)

    # a record begins as the model does, at rest but for a striker: one that begins within a wave
    # has lost what tells the first wave from the next
    n_first = max(1, round(SAMPLING * time_scale / dt))
    begin, model_begin = (
        np.abs(x[:n_first].mean(axis=0)) / np.maximum(np.abs(x).max(axis=0), 1e-300)
        for x in (y, model)
    )
    others = [
        a for a in others if (np.abs(begin[list(a.order)] - model_begin) < REST_DIFFERENCE).all()
    ]

    # motions of one sign are of one wave: with all signs turned, it goes or it comes back
    means = uniform_filter1d(y[:, ~forces], max(1, round(time_scale / dt)), axis=0, mode="nearest")
    high, low = means.max(axis=0), -means.min(axis=0)
    both_ways = (np.minimum(high, low) > OTHER_SIGN * np.maximum(high, low)).all()
    if signed.all() and not both_ways:
        others = [a for a in others if any(s > 0 for s in a.sign)]
    if not others:
        return

    # the best arrangement in the whole record and in its first half and quarter
    from_start = np.abs(y - y[0])
    largest = np.maximum(from_start.max(axis=0), 1e-300)
    first_wave = int((from_start > ARRIVED * largest).any(axis=1).argmax())
    for window in WINDOWS:
        k = first_wave + int(window.share * (len(t) - first_wave))
        c, at_touch = _correlations(y[:k], model, dt, time_scale)
        if c is None:
            return
        correlation = _agreement(c, as_they_are)
        early = max(at_touch - round(EARLIEST_BEGIN / SAMPLING), 0)
        delays = c if window.late else c[..., early:]
        agreements = [(_agreement(delays, a), a) for a in others]
        best, arrangement = max(agreements, key=itemgetter(0))
        is_clear = best > max(window.least, correlation + window.better)
        if is_clear and correlation < GOOD_CORRELATION:
            raise UnusableRecord(_refusal(names, arrangement, best, correlation))


def _refusal(
    names: Sequence[str], arrangement: Arrangement, best: float, as_they_are: float
) -> str:
    """A sentence on the arrangement that agrees better than the columns as they are, with both
    correlations and what to exchange or turn."""
    by = f"(correlation with the model {best:.2f}, as they are {as_they_are:.2f})"
    exchanged = [name for i, name in enumerate(names) if arrangement.order[i] != i]
    turned = [name for i, name in enumerate(names) if arrangement.sign[i] < 0]
    if exchanged:
        return (
            f"the columns {' and '.join(exchanged)} are swapped: the waves pass them in the other "
            f"order {by}; exchange their headings."
        )
    return (
        f"{' and '.join(turned)} {'has' if len(turned) == 1 else 'have'} the wrong sign: motions "
        f"go towards the wall and forces press where they are positive {by}; turn the sign of "
        f"the column{'s' * (len(turned) > 1)} or of the gain."
    )


def _arrangements(m: int, signed: NDArray[np.bool_]) -> Iterator[Arrangement]:
    """Order and signs of m columns: as they are, two exchanged, one turned, all turned."""
    order, sign = tuple(range(m)), np.asarray(signed, int)
    yield Arrangement(order, tuple(sign))
    for i, j in combinations(order, 2):
        exchanged = list(order)
        exchanged[i], exchanged[j] = j, i
        yield Arrangement(tuple(exchanged), tuple(sign))
    turned = [np.array([i]) for i in order if sign[i]]
    if sign.sum() > 1:
        turned.append(np.flatnonzero(sign))
    for columns in turned:
        other_sign = sign.copy()
        other_sign[columns] *= -1
        yield Arrangement(order, tuple(other_sign))


def _agreement(C: NDArray[np.float64], arrangement: Arrangement) -> float:
    """Mean correlation of the columns at their best common stretch and delay; C (r, m, m, s) by
    stretch, column, sensor and delay. Of an unknown sign the better one counts."""
    m = C.shape[1]
    c = C[:, list(arrangement.order), range(m)]
    sign = np.array(arrangement.sign)[:, None]
    return float(np.where(sign == 0, np.abs(c), sign * c).mean(axis=1).max())


def _correlations(
    y: NDArray[np.float64], model: NDArray[np.float64], dt: float, time_scale: float
) -> tuple[NDArray[np.float64] | None, int]:
    """Correlations c_ab (r, m, m, s) by stretch, column of y (k, m), sensor of the model (n, m) and
    delay, and the delay at which the record begins with the first touch; None of a record that is
    too short."""
    step = SAMPLING * time_scale
    at, at_model = (np.arange(0.0, len(x) * dt, step) for x in (y, model))
    q = round(LAG / SAMPLING)
    if len(at) < 4 * q:
        return None, 0
    width = max(1, round(step / dt))
    y, model = (uniform_filter1d(x, width, axis=0, mode="nearest") for x in (y, model))

    def changes(x, times):
        """Changes (k, m) of samples x (.., m) within q of the times [s]."""
        t = dt * np.arange(len(x))
        sampled = np.array([np.interp(times, t, column) for column in x.T]).T
        return sampled[q:] - sampled[:-q]

    of_data = changes(y, at)
    by_delay = np.array(
        [_by_delay(of_data, changes(model, at_model / stretch)) for stretch in STRETCHES]
    )
    return by_delay, min(int(LATEST_TOUCH * len(of_data)), len(at_model) - q - 1)


def _by_delay(y: NDArray[np.float64], model: NDArray[np.float64]) -> NDArray[np.float64]:
    """c_ab (m, m, s) of y (k, m) with model (n, m). Before its first touch the model is at rest:
    whatever the data show there counts against it. What lies before the record, or beyond the end
    of the one or the other, does not count."""
    (k, m), n = y.shape, len(model)
    delay = np.arange(1 - n, k)
    first, last = np.maximum(-delay, 0), np.minimum(k - delay, n)  # of the model within the record

    # squares of both within the time that both have, by sums from the start
    sums_y, sums_model = (np.vstack([np.zeros(m), np.cumsum(x**2, axis=0)]) for x in (y, model))
    squares_y = sums_y[np.minimum(n + delay, k)]
    squares_model = sums_model[last] - sums_model[first]
    enough_y = (squares_y > MIN_SHARED * sums_y[-1]) & (sums_y[-1] > 0.0)
    enough_model = (squares_model > MIN_SHARED * sums_model[-1]) & (sums_model[-1] > 0.0)

    C = np.zeros((m, m, len(delay)))
    for a in range(m):
        for b in range(m):
            product = fftconvolve(y[:, a], model[::-1, b])  # from delay 1 - n to k - 1
            size = np.sqrt(squares_y[:, a] * squares_model[:, b])
            enough = enough_model[:, b] & enough_y[:, a] & (size > 0)
            np.divide(product, size, out=C[a, b], where=enough)
    return C[..., np.abs(delay) <= LATEST_TOUCH * k]


def model_times(t: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n,) [s] times of a model that a record t (k,) may show from, however late it begins."""
    return t[0] + (t[1] - t[0]) * np.arange(round((1.0 + LATEST_TOUCH) * len(t)))
