"""Parameters that a calibration varies: those of a chain and its wall, and their exact derivatives.

The stiffness of contact i is a factor on what the rig has; the trigger is the time on the record's
clock at which the model starts, the first touch.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from beadwave.dem.kernels.laws import ELASTIC_LAWS, SHAPE_PARAMETERS
from beadwave.dem.sensitivities import Directions
from beadwave.workflows.fit.marched_system import Rig

OF_WALL = ("frequency", "mass", "damping")
UNIFORM = 12.0  # the variance of a uniform distribution is its width squared over this
# > 0, varied by factors
RATIOS = (
    "contact",
    "stiffness",
    "preload",
    "striker",
    "frequency",
    "mass",
    "gain",
)


class Parameter(NamedTuple):
    """One number to be fitted; `scale` is a change of it that counts as large."""

    name: str
    # contact, stiffness, a name of SHAPE_PARAMETERS, preload, dissipation, striker, trigger,
    # frequency, mass, damping, gain
    kind: str
    start: float
    low: float
    high: float
    scale: float
    unit: str = ""
    index: int = 0  # of the contact, or of the damping ratio; the sign of a gain

    @property
    def of_wall(self) -> bool:
        """True if it belongs to the wall, else to the chain or the record."""
        return self.kind in OF_WALL

    @property
    def relative(self) -> float:
        """Its scale over its start, for one that is varied by factors."""
        return self.scale / self.start


def trigger(name: str, estimate: float) -> Parameter:
    """The first touch on a record's clock, about its estimate [s]."""
    reach = 1e-4  # [s] bounds of a trigger to either side of its estimate
    low, high = estimate - reach, estimate + reach
    # 3e-6 s: a change of a trigger that counts as large
    return Parameter(name, "trigger", estimate, low, high, 3e-6, "s")


def coordinates(parameters: Sequence[Parameter], theta: np.ndarray) -> np.ndarray:
    """z (p,): what a fit varies, in scales; logarithms of parameters that are varied by factors."""
    return np.array([
        np.log(x) / p.relative if p.kind in RATIOS else x / p.scale
        for p, x in zip(parameters, theta, strict=True)
    ])  # fmt: skip


def values(parameters: Sequence[Parameter], z: np.ndarray) -> np.ndarray:
    """theta (p,) of coordinates z (p,)."""
    return np.array([
        np.exp(x * p.relative) if p.kind in RATIOS else x * p.scale
        for p, x in zip(parameters, z, strict=True)
    ])  # fmt: skip


def slopes(parameters: Sequence[Parameter], theta: np.ndarray) -> np.ndarray:
    """(p,) derivative of theta by z."""
    return np.array([
        x * p.relative if p.kind in RATIOS else p.scale
        for p, x in zip(parameters, theta, strict=True)
    ])  # fmt: skip


def scales(parameters: Sequence[Parameter]) -> np.ndarray:
    """Scale of each parameter, (p,): a change that counts as large."""
    return np.array([p.scale for p in parameters])


def ends(parameters: Sequence[Parameter]) -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper bounds (p,)."""
    return tuple(np.array([getattr(p, end) for p in parameters]) for end in ("low", "high"))


def at_bound(parameters: Sequence[Parameter], value: np.ndarray) -> np.ndarray:
    """(p,) whether each value (p,) lies at one of its bounds; never where a bound is infinite."""
    low, high = ends(parameters)
    # 1e-6 of the bounds' distance: parameters nearer to a bound lie at it
    margin = 1e-6 * (high - low)
    return np.isfinite(margin) & ((value - low <= margin) | (high - value <= margin))


def rig_at(rig: Rig, parameters: tuple[Parameter, ...], theta: np.ndarray) -> Rig:
    """The rig with the parameters at theta (p,) in SI units.

    Ratios of damping of a structure's modes move by what the parameter moves, each by
    `rig.damping`, and stop at 0; a wall of one mass m has phi = m^-1/2.
    """
    chain, wall, v0, trigger, A = rig.chain, rig.wall, rig.v0, rig.trigger, rig.chain.A.copy()
    for p, value in zip(parameters, map(float, theta), strict=True):
        match p.kind:
            case "contact":
                A[p.index] *= value
            case "stiffness":
                A *= value / p.start
            case name if name in SHAPE_PARAMETERS:
                chain = chain._replace(**{name: np.full(A.size, value)})
            case "preload":
                chain = chain._replace(preload=value)
            case "dissipation":
                chain = chain._replace(dissipation="hunt-crossley", gamma=np.full(A.size, value))
            case "striker":
                v0 = np.append(value, v0[1:])
            case "trigger":
                trigger = value
            case "frequency":
                wall = wall._replace(omega=np.array([2.0 * np.pi * value]))
            case "mass":
                wall = wall._replace(phi=np.array([value**-0.5]))
            case "damping":
                zeta = wall.zeta + (value - p.start) * rig.damping[p.index]
                wall = wall._replace(zeta=np.maximum(zeta, 0.0))
    return rig._replace(chain=chain._replace(A=A), wall=wall, v0=v0, trigger=trigger)


def directions(rig: Rig, parameters: tuple[Parameter, ...], theta: np.ndarray) -> Directions:
    """Derivatives of the chain, wall and start by the parameters at theta (p,): those of `rig_at`,
    kind by kind. A trigger and a gain have none, their derivatives follow from the signals."""
    p, n, n_contacts = len(parameters), rig.chain.mass.size, rig.chain.A.size
    k = 0 if rig.wall is None else rig.wall.omega.size
    sizes = (n_contacts, n_contacts, n)
    d = Directions(*(np.zeros((s, p)) for s in sizes), np.zeros(p), *np.zeros((3, k, p)))

    # of a law with parameters of its own (SHAPE_PARAMETERS), (parameters, n_contacts, p)
    law = rig.chain.elastic
    names = [p.name for p in ELASTIC_LAWS[law.name].parameters] if law.name else []
    if names:
        d = d._replace(parameters=np.zeros((len(names), n_contacts, p)))
    A = rig_at(rig, parameters, theta).chain.A
    for j, (parameter, value) in enumerate(zip(parameters, theta, strict=True)):
        match parameter.kind:
            case "contact":
                d.A[parameter.index, j] = A[parameter.index] / value
            case "stiffness":
                d.A[:, j] = A / value
            case name if name in names:
                d.parameters[names.index(name), :, j] = 1.0
            case "preload":
                d.preload[j] = 1.0
            case "dissipation":
                d.gamma[:, j] = 1.0
            case "striker":
                d.v0[0, j] = 1.0
            case "frequency":
                d.omega[0, j] = 2.0 * np.pi
            case "mass":
                d.phi[0, j] = -0.5 * value**-1.5
            case "damping":
                d.zeta[:, j] = rig.damping[parameter.index]
    return d
