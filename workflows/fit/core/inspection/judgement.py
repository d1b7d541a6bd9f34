"""How far to believe what an inspection found: what the records tell, and what they do not."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from workflows.fit.core.inspection.fitting import RecordFit
from workflows.fit.core.inspection.information import bars_over_time, bounds_information, felt_from
from workflows.fit.core.inspection.inversion import Inversion, scales
from workflows.fit.core.parametric_wall import ParametricWall

TOLD = 0.1  # two-sigma bar over the bounds' distance: a number that the records tell
BARELY = 0.5  # the same: one that they tell weakly
COLOURED = 1.3  # memory of a residual that is not white
STRETCHED = 1.05  # of a bar, worth a sentence
ALIKE = 0.9  # correlation worth a sentence
SETTLED = 0.05  # of a bar: what another wall at the answer may move
AT_BOUND = "at its bound"
UNEXPLAINED = "not explained"
INSTANTS = 60  # record lengths for which bars are told


def told_of(inversion: Inversion) -> list[str]:
    """Of each number "yes", "weakly", "no" or "at its bound", by its bar beside its bounds."""
    width = np.array([p.high - p.low for p in inversion.parameters])
    share = inversion.uncertainty.two_sigma / width
    return [
        AT_BOUND if held and one < BARELY else _told(one)
        for one, held in zip(share, inversion.at_bound, strict=True)
    ]


def _told(share: float) -> str:
    return "yes" if share <= TOLD else "weakly" if share <= BARELY else "no"


class Judged(NamedTuple):
    """An answer, others that the records do not tell from it, and how it came about."""

    inversion: Inversion
    rivals: tuple[Inversion, ...]
    fit: RecordFit
    n_shared: int  # numbers of all records, the first ones
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
        """What the records tell of each number: nothing where the model does not explain them."""
        silent = [UNEXPLAINED] * len(self.inversion.parameters)
        return told_of(self.inversion) if self.explained else silent

    @property
    def rival_numbers(self) -> list[dict[str, float]]:
        """The numbers of all records in each other answer."""
        n = self.n_shared
        return [
            {p.name: float(x) for p, x in zip(one.parameters[:n], one.value[:n], strict=True)}
            for one in self.rivals
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
        """[s] on the first record's clock."""
        return self.inversion.value[self.fit.unknowns.trigger[0]]

    def remarks(self) -> Iterator[str]:
        """What there is to be said, in sentences."""
        yield from self._on_misfit()
        yield from self._on_rivals()
        yield from self._on_numbers()
        yield from self._on_wall()

    def _on_misfit(self) -> Iterator[str]:
        """What the residual says of the model."""
        inversion = self.inversion
        whole = inversion.whole_misfit
        if not self.noise_known:
            yield (
                "The records do not tell their noise, 1 % of the largest signal is taken: whether "
                f"{whole:.3g} times of it is noise or a wrong model remains open; measure repeats."
            )
        elif not inversion.explained:
            worst = max(inversion.parts, key=lambda part: part.misfit)
            yield (
                f"THE MODEL DOES NOT EXPLAIN THE RECORDS: it leaves {whole:.3g} times their noise, "
                f"and {worst.misfit:.3g} times from {1e3 * worst.begin:.3g} to "
                f"{1e3 * worst.end:.3g} ms of {self.records[worst.record]}. The structure is "
                "another than the scene says, a number that is off was not among those to find, "
                "or the search has missed it (give more --starts or narrower --bounds); do not "
                "rely on what was found, nor on its bars."
            )
        if inversion.memory > COLOURED:
            yield (
                "What is left goes on from sample to sample (its variance is "
                f"{inversion.memory:.3g} times that of its differences): the bars count with that."
            )

    def _on_rivals(self) -> Iterator[str]:
        for rival in self.rival_numbers:
            told = ", ".join(f"{name} = {value:.6g}" for name, value in rival.items())
            yield (
                f"THE RECORDS CANNOT TELL THIS ANSWER FROM ANOTHER: {told} leaves as little. Bars "
                "are of the one alone; narrow --bounds by what is known, or record for longer."
            )

    def _on_numbers(self) -> Iterator[str]:
        """What the records do not tell, or only together."""
        inversion, n = self.inversion, self.n_shared
        names, told = [p.name for p in inversion.parameters], told_of(inversion)
        silent = [i for i in range(n) if told[i] == "no"]
        for i in silent:
            yield self._why_silent(i)
        for name, value, one in zip(names, inversion.value, told, strict=True):
            if one == AT_BOUND:
                yield f"{name} lies at its bound {value:.4g} or beyond: {_wider(name)}."
        if not silent:
            yield from self._alike(names[:n])
        if inversion.stretch > STRETCHED:
            yield (
                "The misfit rises more slowly than a parabola: bars are up to "
                f"{inversion.stretch:.2g} times as long as its curvature says."
            )
        if silent or "weakly" in told[:n]:
            worst = inversion.uncertainty.combinations[0]
            yield f"Least told by the records: {worst.text(inversion.parameters)}."

    def _alike(self, names: list[str]) -> Iterator[str]:
        for i, one in enumerate(names):
            for j, other in enumerate(names[:i]):
                r = float(self.inversion.uncertainty.correlation[i, j])
                if abs(r) > ALIKE:
                    way = "together" if r > 0 else "one up and one down"
                    yield (
                        f"{other} and {one} move {way} at almost no cost (correlation {r:.2f}): "
                        "each alone is known far worse than the two of them."
                    )

    def _why_silent(self, i: int) -> str:
        """A number that the records do not tell: whether any wave in them has felt it."""
        inversion, t = self.inversion, self.fit.shots[0].t
        parameters = inversion.parameters
        width = np.array([p.high - p.low for p in parameters]) / scales(parameters)
        felt = felt_from(inversion.slopes, width, TOLD)[i]
        length = 1e3 * (t[-1] - self._touch)
        said = f"The records do not tell {parameters[i].name}: its bar is as long as its bounds"
        if felt < len(t):
            return (
                f"{said}. Waves feel it from {1e3 * (t[felt] - self._touch):.3g} ms on, but other "
                "numbers do the same to them: find fewer, or record for longer than "
                f"{length:.3g} ms."
            )
        return (
            f"{said}, and were all else known, no wave within their {length:.3g} ms would tell it: "
            "the first wave that a structure sends back hardly feels its far ends, nor a load "
            "along it. Record later waves as well."
        )

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
            if self.moved > SETTLED:
                yield (
                    "Walls between others are not good enough there for the bars: narrow --bounds."
                )
        if self.inversion.step_error > 1.0:
            yield (
                "The step of the model is seen in the signals by up to "
                f"{self.inversion.step_error:.2g} times the noise: the bars do not hold it."
            )


def _wider(name: str) -> str:
    return "say with --each where it starts" if ", record" in name else "widen --bounds"
