"""Posteriors with several peaks, and evidences, by nested sampling.

    Z = int L(theta) pi(theta) dtheta,    theta = Q(Phi(z)),    z standard normal under the prior

Live points are drawn from the prior and move to ever higher likelihoods (J. Skilling, Bayesian
Analysis 1 (2006) 833; dynesty: J. S. Speagle, MNRAS 493 (2020) 3132), so that no peak is missed
that holds a live point. Lobes are then the connected parts of the nearest-neighbour graph of the
samples. As the evidence of n live points is off by sqrt(H / n), H the information in nats, samples
of a mixture of Student's distributions, one for each lobe, take their place where enough of them
count: their weights L(z) N(z) / q(z) have the evidence as mean, off by 1 / sqrt(effective samples).
"""

from collections.abc import Callable, Mapping, Sequence
from importlib.util import find_spec
from typing import NamedTuple
from warnings import catch_warnings, simplefilter

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import stats
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree
from scipy.special import logsumexp, ndtr, ndtri

from beadwave.system import adding
from beadwave.workflows.scene import InvalidScene


class NestedOptions(NamedTuple):
    """Options of the sampler; the two-lobed frame of the tests needs none other than these."""

    live: int = 600  # live points; a lobe of a share s of the prior is missed with (1 - s)^live
    walk: str = "auto"  # of dynesty: "rslice" and "rwalk" find thin, bent posteriors faster
    remaining: float = 0.01  # of ln Z, in the live points when the sampler stops
    neighbours: int = 15  # of each sample in the graph of lobes
    sparse: float = 0.05  # share of the samples in the thinnest places, not part of the graph
    least: float = 0.005  # mass of a lobe; smaller parts belong to the next one
    drawn: int = 16384  # samples of the mixture
    freedom: float = 6.0  # degrees of freedom of its Student's distributions
    enough: float = 1000.0  # effective ones, for which they take the place of nested samples
    runs: int | None = None  # of the likelihood, at most, before the samples of the mixture
    undetermined: float = 0.8  # spread over that of the prior, above which a parameter is unknown


class Prior(NamedTuple):
    """Distribution of a parameter: its name, and the quantile of a probability."""

    name: str
    quantile: Callable[[ArrayLike], NDArray[np.float64]]


def uniform(name: str, low: float, high: float) -> Prior:
    """Flat between two ends."""
    return Prior(name, lambda p: low + (high - low) * np.asarray(p))


def log_uniform(name: str, low: float, high: float) -> Prior:
    """Flat in the logarithm, between two ends above 0."""
    return Prior(name, lambda p: low * (high / low) ** np.asarray(p))


def normal(name: str, mean: float, deviation: float) -> Prior:
    """Gauss' distribution."""
    return Prior(name, lambda p: mean + deviation * ndtri(p))


def log_normal(
    name: str, mode: float, deviation: float, low: float = 0.0, high: float = np.inf
) -> Prior:
    """exp of a Gaussian of this deviation, with its mode, cut at two ends."""
    whole = stats.lognorm(deviation, scale=mode * np.exp(deviation**2))
    first, last = whole.cdf([low, high])
    return Prior(name, lambda p: whole.ppf(first + (last - first) * np.asarray(p)))


class Lobe(NamedTuple):
    """A peak of the posterior."""

    mass: float  # share of the posterior
    mean: NDArray[np.float64]  # (p,)
    deviation: NDArray[np.float64]  # (p,)
    best: NDArray[np.float64]  # (p,) sample of the largest likelihood


class NestedPosterior(NamedTuple):
    """Weighted samples, evidence and lobes."""

    names: tuple[str, ...]  # (p,)
    samples: NDArray[np.float64]  # (n, p)
    weights: NDArray[np.float64]  # (n,) of sum 1
    log_likelihood: NDArray[np.float64]  # (n,)
    log_evidence: float
    log_evidence_error: float  # one standard deviation
    lobes: tuple[Lobe, ...]  # the heaviest first
    lobe: NDArray[np.int64]  # (n,) of each sample
    spread: NDArray[np.float64]  # (p,) over that of the prior, in its probability
    effective: float  # independent samples
    evaluations: int  # of the likelihood
    complete: bool  # False: stopped by the largest number of runs
    options: NestedOptions = NestedOptions()

    @property
    def mean(self) -> NDArray[np.float64]:
        """Mean (p,) of all lobes."""
        return self.weights @ self.samples

    @property
    def deviation(self) -> NDArray[np.float64]:
        """Standard deviation (p,) of all lobes."""
        return np.sqrt(self.weights @ (self.samples - self.mean) ** 2)

    @property
    def undetermined(self) -> tuple[str, ...]:
        """Parameters of which the data says hardly more than the prior."""
        wide = self.spread > self.options.undetermined
        return tuple(name for name, is_wide in zip(self.names, wide, strict=True) if is_wide)


def nested_posterior(
    log_likelihood: Callable[[NDArray[np.float64]], float],
    priors: Sequence[Prior],
    *,
    seed: int,
    options: NestedOptions = NestedOptions(),
) -> NestedPosterior:
    """Posterior of theta (p,) under independent priors, the same for the same seed.

    log_likelihood takes theta (p,); -inf where it is impossible, NaN counts as -inf. Raises
    InvalidScene where it is impossible everywhere, or dynesty is not installed.
    """
    require_nested_sampler()
    import dynesty

    p, n_evaluations = len(priors), 0

    def parameters(z):
        """theta (n, p) = Q(Phi(z)) of z (n, p)."""
        # tails of the mixture reach beyond what a probability below 1 can say
        inside = np.clip(ndtr(z), 1e-300, 1 - 1e-16)
        return np.stack([q.quantile(x) for q, x in zip(priors, inside.T, strict=True)], -1)

    def likelihood(z):
        """ln L at z (p,)."""
        nonlocal n_evaluations
        n_evaluations += 1
        value = float(log_likelihood(parameters(z[None])[0]))
        # finite in place of ln 0: the difference of two infinite ones would be no number
        return -1e300 if not np.isfinite(value) else value

    # nested sampling on z, which is standard normal under the prior
    sampler = dynesty.NestedSampler(
        likelihood,
        lambda u: ndtri(np.clip(u, 1e-12, 1 - 1e-12)),
        p,
        nlive=options.live,
        sample=options.walk,
        rstate=np.random.default_rng(seed),
    )
    with catch_warnings():
        simplefilter("ignore", UserWarning)  # of a sampler that is stopped: `complete` says it
        sampler.run_nested(dlogz=options.remaining, maxcall=options.runs, print_progress=False)
    run = sampler.results
    complete = options.runs is None or n_evaluations < options.runs
    if np.max(run.logl) <= -1e299:
        raise InvalidScene(
            "the likelihood is 0 wherever the priors allow; widen them, or check the model."
        )
    weights = run.importance_weights()
    z, log_l = run.samples, run.logl
    log_z, error = float(run.logz[-1]), float(run.logzerr[-1])
    effective = 1 / np.sum(weights**2)

    # lobes, of samples drawn by their weights, some several times
    rng = np.random.default_rng(seed + 1)
    equal, counts = np.unique(rng.choice(len(z), 4000, p=weights), return_counts=True)
    label = lobes_of(z[equal], options, counts)
    nearest = cKDTree(z[equal])
    lobe = label[nearest.query(z)[1]]

    # samples of a mixture, Student's distribution for each lobe: by Halton's points, of which
    # means are ten times nearer than of random ones (1e-3 of a deviation in three parameters)
    masses = np.bincount(lobe, weights)
    counts = np.maximum(np.round(options.drawn * masses / masses.sum()).astype(int), 2 * p)
    parts, drawn = [], []
    for k, n in enumerate(counts):
        w = weights * (lobe == k) / masses[k]
        centre = w @ z
        # 1e-12: a lobe of a few equal samples has a covariance all the same
        covariance = (w[:, None] * (z - centre)).T @ (z - centre) + 1e-12 * np.eye(p)
        parts.append(stats.multivariate_t(centre, covariance, df=options.freedom))
        points = stats.qmc.Halton(p + 1, rng=seed + k).random(n)
        normal_z = stats.norm.ppf(points[:, :p]) @ np.linalg.cholesky(covariance).T
        share = stats.chi2.ppf(points[:, p:], options.freedom) / options.freedom
        drawn.append(centre + normal_z / np.sqrt(share))
    drawn, shares = np.concatenate(drawn), counts[:, None] / counts.sum()

    # importance weights L N / q with q the density of the whole mixture, not of the part that a
    # sample was drawn from: where lobes overlap they stay bounded
    log_q = logsumexp([part.logpdf(drawn) for part in parts], axis=0, b=shares)
    drawn_l = np.array([likelihood(x) for x in drawn])
    log_w = drawn_l + stats.norm.logpdf(drawn).sum(axis=1) - log_q
    w = np.exp(log_w - log_w.max())
    enough = float(w.sum() ** 2 / np.sum(w**2))
    if enough > options.enough:
        log_z = float(np.log(w.mean()) + log_w.max())
        error = float(np.std(w) / w.mean() / np.sqrt(len(w)))
        z, log_l, weights, effective = drawn, drawn_l, w / w.sum(), enough
        lobe = label[nearest.query(z)[1]]

    # sqrt(12): the spread of a prior's own probability, uniform between 0 and 1, is then 1
    theta, probability = parameters(z), ndtr(z)
    middle = weights @ probability
    spread = np.sqrt(12 * (weights @ (probability - middle) ** 2))
    lobes, order = [], np.argsort(-np.bincount(lobe, weights))
    for k in order:
        w = weights * (lobe == k)
        mass = float(w.sum())
        mean = w @ theta / mass
        deviation = np.sqrt(w @ (theta - mean) ** 2 / mass)
        best = theta[np.where(lobe == k, log_l, -np.inf).argmax()]
        lobes.append(Lobe(mass, mean, deviation, best))
    return NestedPosterior(
        tuple(prior.name for prior in priors), theta, weights, log_l, log_z, error, tuple(lobes),
        np.argsort(order)[lobe], spread, float(effective), n_evaluations, complete, options,
    )  # fmt: skip


def quantiles(
    x: NDArray[np.float64], weights: NDArray[np.float64], shares: Sequence[float]
) -> list[float]:
    """Values below which these shares of the samples x (n,) of the weights (n,) lie, linear between
    two samples; the ends of the samples beyond half a weight of them."""
    order = np.argsort(x)
    cumulative = np.cumsum(weights[order])
    # a sample stands in the middle of its weight
    at = (cumulative - 0.5 * weights[order]) / cumulative[-1]
    return [float(q) for q in np.interp(shares, at, x[order])]


def lobes_of(
    z: NDArray[np.float64], options: NestedOptions, weight: NDArray | None = None
) -> NDArray[np.int64]:
    """The lobe (n,) of each of the samples z (n, p): connected parts of the graph of neighbours,
    each of `options.least` of all weight (n,) at least, alike without it.

    Samples in the thinnest places, which may bridge two lobes, join the lobe of the nearest one.
    """
    scaled = (z - z.mean(axis=0)) / np.maximum(z.std(axis=0), 1e-300)

    # the graph of the dense samples: distance to the last neighbour falls with the density
    distances = cKDTree(scaled).query(scaled, options.neighbours + 1)[0]
    dense = np.flatnonzero(distances[:, -1] <= np.quantile(distances[:, -1], 1 - options.sparse))
    tree = cKDTree(scaled[dense])
    neighbours = tree.query(scaled[dense], options.neighbours + 1)[1][:, 1:]
    rows = np.repeat(np.arange(len(dense)), options.neighbours)
    graph = coo_array((np.ones(rows.size), (rows, neighbours.ravel())), (len(dense),) * 2)
    _, part = connected_components(graph, directed=False)

    # small parts belong to the nearest sample of a large one
    weight = np.ones(len(z)) if weight is None else weight
    large = np.flatnonzero(np.bincount(part, weight[dense]) >= options.least * weight.sum())
    in_large = np.isin(part, large)
    nearest = cKDTree(scaled[dense[in_large]]).query(scaled)[1]
    return np.searchsorted(large, part[in_large][nearest])


def frequencies_log_likelihood(
    computed_hz: ArrayLike, measured_hz: ArrayLike, deviation: ArrayLike, model_error: float = 0.0
) -> float:
    """ln L of measured frequencies (n,) with relative deviations (n,), and of a relative model
    error that is a parameter of the fit: it keeps bars from being smaller than the scatter between
    copies of a part.

        ln L = -1/2 sum_i [(ln f_i / f_m,i)^2 / s_i^2 + ln(2 pi s_i^2)],   s_i^2 = d_i^2 + e^2
    """
    misfit = np.log(np.asarray(computed_hz, float) / measured_hz)
    square = np.asarray(deviation, float) ** 2 + model_error**2
    return float(-0.5 * np.sum(misfit**2 / square + np.log(2 * np.pi * square)))


def model_probabilities(evidences: Mapping[str, float]) -> dict[str, float]:
    """Probability of each model by its ln Z, all as likely before the data.

    >>> round(model_probabilities({"tied": -3.0, "sprung": -3.0})["tied"], 9)
    0.5
    """
    values = np.array(list(evidences.values()))
    shares = np.exp(values - logsumexp(values))
    return dict(zip(evidences, shares.tolist(), strict=True))


def require_nested_sampler() -> None:
    """Raise InvalidScene where the sampler is not installed."""
    if find_spec("dynesty") is None:
        raise InvalidScene(f"nested sampling needs dynesty; {adding('posterior')} adds it.")
