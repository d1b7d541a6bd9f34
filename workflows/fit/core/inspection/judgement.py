"""How far to believe an inspection: what the records determine, and what they do not."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from workflows.fit.core.calibration.parameters import scales
from workflows.fit.core.inspection.fitting import RecordFit
from workflows.fit.core.inspection.information import bars_over_time, bounds_information, felt_from
from workflows.fit.core.inspection.inversion import Inversion
from workflows.fit.core.parametric_wall import ParametricWall

AT_BOUND = "at its bound"
UNEXPLAINED = "not explained"
INSTANTS = 60  # record lengths for which bars are computed


class InspectionLimits(NamedTuple):
    """When a number is said to be told by the records, and when a sentence is worth saying. None
    of these numbers has been varied systematically."""

    told: float = 0.1  # two-sigma bar over the bounds' distance of a number that is determined
    barely: float = 0.5  # the same, of one that is determined weakly
    coloured: float = 1.3  # memory of a residual that is not white
    stretched: float = 1.05  # factor on a bar by the profile of the misfit
    alike: float = 0.9  # correlation of two numbers
    settled: float = 0.05  # of a bar, that a further wall computed at the answer may move


LIMITS = InspectionLimits()


def told_of(inversion: Inversion) -> list[str]:
    """Of each number "yes", "weakly", "no" or "at its bound", by its bar beside its bounds."""
    width = np.array([p.high - p.low for p in inversion.parameters])
    verdicts = []
    for share, at_bound in zip(
        inversion.uncertainty.two_sigma / width, inversion.at_bound, strict=True
    ):
        if at_bound and share < LIMITS.barely:
            verdicts.append(AT_BOUND)
        else:
            verdicts.append(
                "yes" if share <= LIMITS.told else "weakly" if share <= LIMITS.barely else "no"
            )
    return verdicts


class Judged(NamedTuple):
    """An answer, others that the records do not tell from it, and how it came about."""

    inversion: Inversion
    rivals: tuple[Inversion, ...]
    fit: RecordFit
    n_shared: int  # numbers of the structure, the first ones
    noise_known: bool
    between: ParametricWall | None
    moved: float | None  # bars by which the last computed wall moved it
    records: tuple[str, ...]
    no_wall: str = ""  # why no wall could be computed at the answer

    @property
    def explained(self) -> bool:
        """Whether the model explains the records, as far as their noise is known; where no wall can
        be computed at the answer there is no model of it."""
        return not self.no_wall and (not self.noise_known or self.inversion.explained)

    @property
    def told(self) -> list[str]:
        """Verdict on each number: "not explained" for all where the model does not explain the
        records, for then a short bar means nothing."""
        if self.explained:
            return told_of(self.inversion)
        return [UNEXPLAINED] * len(self.inversion.parameters)

    @property
    def rival_numbers(self) -> list[dict[str, float]]:
        """The numbers of the structure in each rival answer."""
        n = self.n_shared
        return [
            {p.name: float(x) for p, x in zip(r.parameters[:n], r.value[:n], strict=True)}
            for r in self.rivals
        ]

    def bars_by_length(self) -> tuple[np.ndarray, np.ndarray]:
        """Times (k,) [s] since the first touch, and the bars (k, p) of records that end there."""
        inversion, t = self.inversion, self.fit.shots[0].t
        k = len(t)
        ends = np.unique(np.linspace(k / INSTANTS, k, INSTANTS).astype(int))
        bars = bars_over_time(inversion.slopes, bounds_information(inversion.parameters), ends)
        return t[ends - 1] - self._touch, bars * scales(inversion.parameters)

    @property
    def _touch(self) -> float:
        """First touch [s] on the first record's clock."""
        return self.inversion.value[self.fit.unknowns.trigger[0]]

    def remarks(self) -> Iterator[str]:
        """Sentences on the misfit, on rival answers, on the numbers and on the wall."""
        yield from self._on_misfit()
        for rival in self.rival_numbers:
            values = ", ".join(f"{name} = {value:.6g}" for name, value in rival.items())
            yield (
                f"THE RECORDS CANNOT TELL THIS ANSWER FROM ANOTHER: {values} leaves as little. "
                "Bars are of the one alone; narrow --bounds by what is known, or record for longer."
            )
        yield from self._on_numbers()
        yield from self._on_wall()

    def _on_misfit(self) -> Iterator[str]:
        """What the residual says of the model."""
        inversion = self.inversion
        misfit = inversion.whole_misfit
        if not self.noise_known:
            yield (
                "The records do not tell their noise, 1 % of the largest signal is taken: whether "
                f"{misfit:.3g} times of it is noise or a wrong model remains open; measure repeats."
            )
        elif not inversion.explained:
            worst = max(inversion.parts, key=lambda part: part.misfit)
            yield (
                f"THE MODEL DOES NOT EXPLAIN THE RECORDS: it leaves {misfit:.3g} times their "
                f"noise, and {worst.misfit:.3g} times from {1e3 * worst.begin:.3g} to "
                f"{1e3 * worst.end:.3g} ms of {self.records[worst.record]}. The structure is "
                "another than the scene says, a number that is off was not among those to find, "
                "or the search has missed it (give more --starts or narrower --bounds); do not "
                "rely on what was found, nor on its bars."
            )
        elif not inversion.noisy:
            yield (
                f"What is left is {misfit:.3g} times the noise, no more than the known errors of "
                "the model (mesh, reduction, theory) leave; the bars hold these."
            )
        if inversion.memory > LIMITS.coloured:
            yield (
                "What is left goes on from sample to sample (its variance is "
                f"{inversion.memory:.3g} times that of its differences): the bars count with that."
            )

    def _on_numbers(self) -> Iterator[str]:
        """What the records do not determine, or only together with another number."""
        inversion, n = self.inversion, self.n_shared
        names = [p.name for p in inversion.parameters]
        verdicts = told_of(inversion)
        undetermined = [i for i in range(n) if verdicts[i] == "no"]

        for i in undetermined:
            # were it determined if all others were known? then others do the same to the waves
            t = self.fit.shots[0].t
            length = 1e3 * (t[-1] - self._touch)
            width = np.array([p.high - p.low for p in inversion.parameters])
            felt = felt_from(inversion.slopes, width / scales(inversion.parameters), LIMITS.told)
            opening = f"The records do not tell {names[i]}: its bar is as long as its bounds"
            if felt[i] < len(t):
                yield (
                    f"{opening}. Waves feel it from {1e3 * (t[felt[i]] - self._touch):.3g} ms on, "
                    "but other numbers do the same to them: find fewer, or record for longer than "
                    f"{length:.3g} ms."
                )
            else:
                yield (
                    f"{opening}, and were all else known, no wave within their {length:.3g} ms "
                    "would tell it: the first wave that a structure sends back hardly feels its "
                    "far ends, nor a load along it. Record later waves as well."
                )
        for name, value, verdict in zip(names, inversion.value, verdicts, strict=True):
            if verdict == AT_BOUND:
                of_record = ", record" in name
                remedy = "say with --each where it starts" if of_record else "widen --bounds"
                yield f"{name} lies at its bound {value:.4g} or beyond: {remedy}."
        for i in range(n) if not undetermined else ():
            for j in range(i):
                r = float(inversion.uncertainty.correlation[i, j])
                if abs(r) > LIMITS.alike:
                    way = "together" if r > 0 else "one up and one down"
                    yield (
                        f"{names[j]} and {names[i]} move {way} at almost no cost (correlation "
                        f"{r:.2f}): each alone is known far worse than the two of them."
                    )
        if inversion.stretch > LIMITS.stretched:
            yield (
                "The misfit rises more slowly than a parabola: bars are up to "
                f"{inversion.stretch:.2g} times as long as its curvature says."
            )
        if undetermined or "weakly" in verdicts[:n]:
            worst = inversion.uncertainty.combinations[0]
            yield f"Least told by the records: {worst.text(inversion.parameters)}."

    def _on_wall(self) -> Iterator[str]:
        """How far the interpolation and the step of the model may be believed."""
        between = self.between
        if self.no_wall:
            yield (
                "THE MODEL DOES NOT EXPLAIN THE RECORDS: no wall can be computed at the answer "
                f"({self.no_wall.rstrip('.')}). What is shown is of walls around it; do not rely "
                "on what was found, nor on its bars. The structure is another than the scene says, "
                "or --bounds are too wide."
            )
        elif between:
            yield (
                f"The wall lies between {between.n_walls} that were computed; one that is left out "
                f"is missed by up to {100 * between.missed.frequency:.2g} % in the frequency of a "
                f"mode. The one computed at the answer moved it by {self.moved:.2g} of its bars at "
                "last."
            )
            if self.moved > LIMITS.settled:
                yield (
                    "Walls between others are not good enough there for the bars: narrow --bounds."
                )
        if self.inversion.step_error > 1.0:
            yield (
                "The step of the model is seen in the signals by up to "
                f"{self.inversion.step_error:.2g} times the noise; the bars hold what it does "
                "to the numbers."
            )
