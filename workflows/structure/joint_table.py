"""Joints that are known from their drawing, as `look` and `modes` show them."""

from collections.abc import Sequence
from math import isfinite

import numpy as np
from pydantic import BaseModel

from beadwave import fem
from beadwave.workflows.report.tables import aligned_text
from beadwave.workflows.stages.structure.bolted_joints import BoltedPlace

PRELOAD = "stated, or of a torque T = 0.2 F d"
HELD = "radius of the foot of the pressure cone"
SHEAR = "a foot that sticks gives in the mesh"
READING = "x/: factor of one standard deviation; two of kx span from sticking to slipping faces"


class JointRow(BaseModel):
    """Equal bolts of a joint, by formula; a deviation is that of the logarithm, 0 of a spring that
    the scene gives. Stiffnesses are None where the scene has them rigid."""

    name: str
    between: str
    number: int  # of equal bolts
    bolt: str
    preload_N: float
    preload_deviation_N: float
    utilisation: float  # preload over proof load
    washer_m: float  # radius of the discs held
    bolt_N_m: float
    members_N_m: float
    wileman_N_m: float | None  # the members' by Wileman, of steel
    mesh_m_N: float  # compliance of the mesh between the discs held, which is taken off
    slipped_N_m: float  # along the faces after slip
    kx_N_m: float | None
    ky_N_m: float | None
    kz_N_m: float | None
    krx_N_m_rad: float | None
    kry_N_m_rad: float | None
    krz_N_m_rad: float | None
    kx_deviation: float
    ky_deviation: float
    kz_deviation: float
    krx_deviation: float
    kry_deviation: float
    krz_deviation: float
    slip_load_N: float


def joint_rows(places: Sequence[BoltedPlace]) -> list[JointRow]:
    """A row for the equal bolts of each joint."""
    rows: list[JointRow] = []
    for place in places:
        stiffness = place.stiffness
        springs, spread = {}, {}
        for key, k, s in zip(fem.DIRECTIONS, place.springs, place.deviation, strict=True):
            unit = "N_m_rad" if key.startswith("kr") else "N_m"
            springs[f"{key}_{unit}"] = float(k) if isfinite(k) else None
            spread[f"{key}_deviation"] = float(s)
        row = JointRow(
            name=place.joint, between=place.pair, number=1, bolt=place.bolt,
            preload_N=place.preload, preload_deviation_N=place.preload_deviation,
            utilisation=place.utilisation, washer_m=stiffness.held, bolt_N_m=stiffness.bolt,
            members_N_m=stiffness.members, wileman_N_m=stiffness.wileman,
            mesh_m_N=stiffness.mesh, slipped_N_m=stiffness.slipped.kx,
            slip_load_N=stiffness.slip_load, **springs, **spread,
        )  # fmt: skip
        for other in rows:
            if _alike(row, other):
                other.number += 1
                break
        else:
            rows.append(row)
    return rows


def _alike(row: JointRow, other: JointRow) -> bool:
    """True for bolts whose names agree, and whose numbers do but for rounding."""
    pairs = zip(row.model_dump(exclude={"number"}).values(),
                other.model_dump(exclude={"number"}).values(), strict=True)  # fmt: skip
    return all(
        np.isclose(a, b, rtol=1e-6, atol=0) if isinstance(a, float) and isinstance(b, float)
        else a == b
        for a, b in pairs
    )  # fmt: skip


def joints_text(rows: Sequence[JointRow]) -> str:
    """The rows as columns, each line with the reason of its numbers."""

    def spring(row: JointRow, key: str) -> str:
        """A stiffness with the factor of one deviation."""
        k = getattr(row, f"{key}_N_m_rad" if key.startswith("kr") else f"{key}_N_m")
        s = getattr(row, f"{key}_deviation")
        return "rigid" if k is None else f"{k:.3g}" + (f" x/ {np.exp(s):.2g}" if s else "")

    lines = {
        ("between", ""): lambda r: r.between,
        ("bolts", ""): lambda r: f"{r.number} x {r.bolt}",
        ("preload [kN]", PRELOAD): lambda r: (
            f"{r.preload_N / 1e3:.4g} +- {r.preload_deviation_N / 1e3:.2g}"
        ),
        ("of proof load", ""): lambda r: f"{100 * r.utilisation:.0f} %",
        ("slip load [kN]", "friction times preload"): lambda r: f"{r.slip_load_N / 1e3:.3g}",
        ("bolt [N/m]", "shank and thread in series"): lambda r: f"{r.bolt_N_m:.4g}",
        ("members [N/m]", "Shigley's cones of 30 degrees"): lambda r: f"{r.members_N_m:.4g}",
        ("  by Wileman", "of steel alone"): lambda r: (
            None if r.wileman_N_m is None else f"{r.wileman_N_m:.4g}"
        ),
        ("held [mm]", HELD): lambda r: f"{1e3 * r.washer_m:.3g}",
        ("mesh [m/N]", "between the discs held, taken off"): lambda r: f"{r.mesh_m_N:.3g}",
        ("kz [N/m]", "what is left of bolt and members"): lambda r: spring(r, "kz"),
        ("kx, ky [N/m]", SHEAR): lambda r: spring(r, "kx"),
        ("krx, kry [N m/rad]", "kz a^2 / 4, a the radius held"): lambda r: spring(r, "krx"),
        ("krz [N m/rad]", "kx a^2 / 2"): lambda r: spring(r, "krz"),
        ("kx after slip [N/m]", "the bolt alone, by Huth"): lambda r: f"{r.slipped_N_m:.3g}",
    }
    cells = [(line, *map(value, rows), reason) for (line, reason), value in lines.items()]
    return f"{aligned_text(('joint', *(row.name for row in rows), ''), cells)}\n{READING}"
