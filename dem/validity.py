"""Limits of the contact law, and how far a run exceeds them.

Hertz' law holds for contacts that are small relative to the spheres, for elastic material, and for
impacts that are slow relative to sound. Beyond these limits even an exact solution of the equations
does not predict an experiment.
K. L. Johnson, Contact Mechanics, Cambridge 1985, sec. 4.2, 6.1 (first yield at a pressure of 1.6
times the yield stress) and 11.4 (quasi-static impacts).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from beadwave.dem.chain import Chain
from beadwave.dem.checks import InvalidChain
from beadwave.dem.kernels.arguments import Array
from beadwave.dem.spheres import (
    contact_radius,
    max_pressure,
    modulus_of_contact,
    radii_of_contacts,
    yielded_radius,
)
from beadwave.dem.trajectory import Trajectory

# limits of the model, as the sources above state them
SMALL_CONTACT = 0.1  # contact radius over the smaller sphere's
SLOW = 0.01  # speed over that of sound in a bar
# of the largest force at a contact, from which on preload and weight are its cause
MOSTLY_AT_REST = 0.5
HARD = 0.01  # yield stress over Young's modulus of a hard material, as hardened steel


class Strain(NamedTuple):
    """Largest values of a run that the limits of the model are compared with."""

    radius_ratio: float  # contact radius over the smaller radius
    pressure: float  # [Pa] at the contact nearest to or farthest beyond first yield
    yield_pressure: float  # [Pa] of first yield there
    contact: str  # which one that is, in words
    yield_stress: float | None  # [Pa] of its softer side; None: HARD times Young's modulus
    speed_ratio: float  # largest speed over the speed of sound
    of_wall: bool = False  # the softer side there is the wall's
    # force before the impact, of preload and weight, over the largest one: at that contact, and at
    # the one of the largest radius
    at_rest: float = 0.0
    at_rest_largest: float = 0.0


def strain(
    chain: Chain,
    young: ArrayLike,
    contact_force: Array,
    v: Array,
    *,
    yield_stress: ArrayLike | None = None,
    of_wall: tuple[float, float] | None = None,
) -> Strain:
    """Strain of a run; young (n,) [Pa], contact_force (k, n_contacts), v (k, n).

    yield_stress (n,) [Pa] of the spheres, and `of_wall` young [Pa] and yield stress of the wall;
    where they are None or nan, those of a hard material, so that a warning holds for any softer
    one. The pressure is not compared where contacts yield by their own law (`yield_overlap`).
    Raises InvalidChain.
    """
    for name, values in (("young", young), ("contact_force", contact_force), ("v", v)):
        if not np.isfinite(values).all():
            raise InvalidChain(f"{name} of the run has values that are not finite; march it anew")

    # each contact at its largest force: relative radius R, the smaller sphere, the softer material
    young = np.broadcast_to(np.asarray(young, float), chain.mass.shape)
    peak = np.asarray(contact_force).max(axis=0, initial=0.0)
    R = radii_of_contacts(chain.radius)
    smaller = np.append(np.minimum(chain.radius[:-1], chain.radius[1:]), chain.radius[-1:])
    R, smaller = R[: peak.size], smaller[: peak.size]
    E_star = modulus_of_contact(chain.elastic.hertz(peak), R)

    # first yield lies below the surface where p0 = 1.6 Y (Johnson, sec. 6.1), Y of the softer side
    stated = np.full(len(young), np.nan) if yield_stress is None else np.asarray(yield_stress)
    stated = np.broadcast_to(stated.astype(float), chain.mass.shape)
    E_wall, Y_wall = of_wall or (np.inf, np.nan)
    stated, of_all = np.append(stated, Y_wall), np.append(young, E_wall)
    Y = np.where(np.isnan(stated), HARD * of_all, stated)
    softer = np.where(Y[1:] < Y[:-1], np.arange(1, Y.size), np.arange(Y.size - 1))[: peak.size]
    # the largest pressure at first yield is 1.6 times the yield stress
    yielding = 1.6 * Y[softer]
    pressure = max_pressure(peak, R, E_star) * (chain.yield_overlap is None)
    worst = int((pressure / yielding).argmax()) if peak.size else None

    # c = sqrt(E / rho) of a bar, rho from mass and radius
    sound = np.sqrt(young / (chain.mass / (4.0 / 3.0 * np.pi * chain.radius**3)))
    if chain.yield_overlap is None:
        a = contact_radius(peak, R, E_star)
    else:
        a = yielded_radius(peak, R, chain.A, chain.yield_overlap)
    # what the contacts carry before anything moves
    rest = np.zeros(peak.size)
    if len(contact_force):
        rest = np.asarray(contact_force)[0] / np.maximum(peak, 1e-300)
    widest = int((a / smaller).argmax()) if peak.size else None
    return Strain(
        float((a / smaller).max(initial=0.0)),
        0.0 if worst is None else float(pressure[worst]),
        np.inf if worst is None else float(yielding[worst]),
        "" if worst is None else place(worst, chain.mass.size),
        None if worst is None or np.isnan(stated[softer[worst]]) else float(stated[softer[worst]]),
        float((np.abs(v).max(axis=0) / sound).max()),
        worst is not None and int(softer[worst]) == len(young),
        0.0 if worst is None else float(rest[worst]),
        0.0 if widest is None else float(rest[widest]),
    )


def outside(strain: Strain) -> tuple[str, ...]:
    """A sentence for each limit of the model that a run has passed."""
    sentences = []
    radius = strain.radius_ratio / SMALL_CONTACT
    if radius > 1:
        sentences.append(
            f"A contact grows to {strain.radius_ratio:.2g} of the sphere's radius, where Hertz' "
            f"law requires less than {SMALL_CONTACT:g}; {less(radius, strain.at_rest_largest)} or "
            "take a stiffer material."
        )
    pressure = strain.pressure / strain.yield_pressure
    if pressure > 1:
        scale, unit = (1e-9, "GPa") if strain.yield_pressure >= 1e8 else (1e-6, "MPa")
        limit = f"the {scale * strain.yield_pressure:.3g} {unit} at which "
        remedy = ""
        if strain.yield_stress is None:
            limit += (
                f"its softer side would yield with a yield stress of {100 * HARD:g} % of Young's "
                "modulus, which few materials reach"
            )
            key = "the yield_stress of the wall" if strain.of_wall else "chain.yield_stress"
            remedy = f", or state {key} of a harder one"
        else:
            limit += f"its softer side yields, 1.6 times {scale * strain.yield_stress:.3g} {unit}"
        sentences.append(
            f"The pressure of the contact {strain.contact} reaches "
            f"{scale * strain.pressure:.3g} {unit}, above {limit}; the elastic contact is too "
            f"stiff there: {less(pressure, strain.at_rest)}{remedy}."
        )
    if strain.speed_ratio > SLOW:
        sentences.append(
            f"A sphere moves at {strain.speed_ratio:.2g} of the speed of sound in it, where a "
            f"static contact law requires less than {SLOW:g}; reduce the striker's velocity."
        )
    return tuple(sentences)


def less(beyond: float, at_rest: float) -> str:
    """The remedy at a contact whose radius or pressure is `beyond` times its limit, of a force of
    which this share is there at rest: both go with its cube root."""
    if at_rest < MOSTLY_AT_REST and beyond * at_rest ** (1 / 3) < 1:
        return "reduce the striker's velocity"
    share = f"{100 * at_rest:.0f} % of its force are there before the impact"
    return f"{share}, of preload and weight: reduce these"


def place(contact: int, n_spheres: int) -> str:
    """Words for a contact, counted from 0."""
    if contact == n_spheres - 1:
        return "at the wall"
    return f"of spheres {contact + 1} and {contact + 2}"


def yielding(row: Chain, run: Trajectory) -> tuple[str, ...]:
    """A sentence on the contacts that a run has pressed beyond their yield."""
    if row.yield_overlap is None:
        return ()
    first = row.A * row.yield_overlap**1.5
    ratio = run.contact_force.max(axis=0) / first
    worst, n = int(ratio.argmax()), ratio.size
    if not ratio[worst] > 1.0:
        return ("No contact yields.",)
    where = place(worst, len(row.mass))
    return (
        f"{(ratio > 1.0).sum()} of {n} contacts yield; the one {where} most, pressed to "
        f"{ratio[worst]:.3g} times the {first[worst]:.3g} N at which it starts to.",
    )
