"""Faces in contact under the preload of bolts: numbers, table, arrays and a picture of zone and
pressure."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from beadwave import fem
from beadwave.fem.contact.preloaded_contact import (
    OPEN,
    STUCK,
    PreloadedContact,
    pressure_error,
    rim,
)
from beadwave.workflows.files.npz import npz
from beadwave.workflows.files.run_folder import Picture
from beadwave.workflows.report.summary import ContactRow
from beadwave.workflows.report.tables import aligned_text
from beadwave.workflows.scene import Scene
from beadwave.workflows.stages.structure.meshed_parts import Parts

CLOSE = 1e-8  # [m] up to which faces without a load fit each other: rounding and chords
STATES = {0: "open", 1: "closed, slides", 2: "closed, sticks"}
READING = """\
zone: of a bolt, with its hole;  stuck: share of the zone whose shear under the preload is below
friction times pressure;  errors: of the zone's area by half of the facets at its rim, of the
pressure by its jumps between facets, and no less than the zone's"""


def contact_numbers(scene: Scene, mesh: Parts, model: fem.Model) -> list[ContactRow]:
    """The rows of a model's faces in contact."""
    return contact_rows(model.contact, mesh)


def contact_files(scene: Scene, model: fem.Model) -> dict[str, bytes]:
    """Content of contact.npz and its picture, by name."""
    picture = contact_picture(model.contact)
    return {
        "contact.npz": contact_arrays(model.contact),
        f"figures/{picture.name}.png": picture.png,
    }


def contact_rows(contact: PreloadedContact | None, mesh: Parts) -> list[ContactRow]:
    """A row for each joint; of two faces a facet belongs to the bolt that is nearest to it."""
    if contact is None:
        return []
    area, (groups, of_facet) = contact.facets.area, mesh.pressed_groups(contact.facets)
    at_rim, rows = rim(contact), []
    for joint in dict.fromkeys(name for name, _ in groups):
        of_joint = [i for i, (name, _) in enumerate(groups) if name == joint]
        mine = np.isin(of_facet, of_joint)
        on = mine & (contact.state != OPEN)
        zone = float(area[on].sum())
        holes = [place.hole if place else 0.0 for _, place in (groups[i] for i in of_joint)]
        per_bolt = zone / len(of_joint) / np.pi + np.mean(np.square(holes)) / 4
        part = contact._replace(state=np.where(mine, contact.state, OPEN))
        zone_error = float(area[mine & at_rim].sum() / 2 / max(zone, 1e-300))
        rows.append(
            ContactRow(
                joint=joint,
                zone_area_m2=zone,
                zone_radius_m=float(np.sqrt(per_bolt)),
                pressure_max_Pa=float(contact.pressure[mine].max()),
                force_N=float(contact.pressure[mine] @ area[mine]),
                stuck_share=float(area[mine & (contact.state == STUCK)].sum() / max(zone, 1e-300)),
                # of a force that is known: a few facets alike jump less than they miss
                pressure_error=max(pressure_error(part), zone_error),
                zone_error=zone_error,
                follows_preload=bool(
                    contact.rough[on].any() or np.abs(contact.start[mine]).max() > CLOSE
                ),
            )
        )
    return rows


def contacts_text(rows: Sequence[ContactRow]) -> str:
    """The rows as a table, with how to read its columns."""
    cells = [
        (
            row.joint,
            f"{1e6 * row.zone_area_m2:.4g} ± {100 * row.zone_error:.2g} %",
            f"{1e3 * row.zone_radius_m:.3g}",
            f"{1e-6 * row.pressure_max_Pa:.3g}",
            f"{100 * row.pressure_error:.2g} %",
            f"{1e-3 * row.force_N:.4g}",
            f"{100 * row.stuck_share:.0f} %",
        )
        for row in rows
    ]
    head = (
        "contact", "zone [mm^2]", "radius [mm]", "highest pressure [MPa]", "its error",
        "force [kN]", "stuck",
    )  # fmt: skip
    return "\n".join([aligned_text(head, cells), READING, *preload_sentences(rows)])


def preload_sentences(rows: Sequence[ContactRow]) -> list[str]:
    """Sentences on the joints whose zones and frequencies follow the preload, and on the others."""
    following = [row.joint for row in rows if row.follows_preload]
    others = [row.joint for row in rows if not row.follows_preload]
    sentences = []
    if following:
        sentences.append(
            f"{', '.join(following)}: faces that are apart, curved unlike each other or rough; "
            "zone and frequencies change with the preload."
        )
    if others:
        sentences.append(
            f"{', '.join(others)}: hard faces that fit each other; neither zone nor frequencies "
            "depend on the preload."
        )
    return sentences


def contact_arrays(contact: PreloadedContact, **more: NDArray[np.float64]) -> bytes:
    """contact.npz: points (n, 3) [m], area (n,) [m^2], pressure (n,) [Pa], gap (n,) [m], state (n,)
    0 open, 1 closed and sliding, 2 closed and stuck, and more arrays by their names."""
    return npz(
        {
            "points": contact.facets.points,
            "area": contact.facets.area,
            "pressure": contact.pressure,
            "gap": contact.gap,
            "state": contact.state,
            **more,
        }
    )


def contact_picture(contact: PreloadedContact) -> Picture:
    """Pressure and state of the facets, as discs of their area, along the two global axes that span
    the faces best."""
    from beadwave.workflows.report import plots  # matplotlib takes a third of a second

    figure, axes = plots.subplots(1, 2, (10, 4.4))
    first, second = contact.facets.spanned
    at = 1e3 * contact.facets.points[:, [first, second]]
    size, on = 2e3 * np.sqrt(contact.facets.area / np.pi), contact.state != OPEN

    plots.discs(axes[0], at[~on], size[~on], facecolors="0.85")
    pressed = plots.discs(
        axes[0], at[on], size[on], array=1e-6 * contact.pressure[on], cmap="viridis"
    )
    figure.colorbar(pressed, ax=axes[0], label="pressure [MPa]", shrink=0.8)
    for state, colour in ((0, "0.85"), (1, "tab:orange"), (2, "tab:blue")):
        of = contact.state == state
        plots.discs(axes[1], at[of], size[of], facecolors=colour)
        axes[1].plot([], [], "o", color=colour, label=STATES[state])
    figure.legend(loc="outside upper right", ncols=3, fontsize=8, frameon=False)
    for axis in axes:
        axis.autoscale_view()
        axis.set_aspect("equal")
        axis.set_xlabel(f"{'xyz'[first]} [mm]")
        axis.set_ylabel(f"{'xyz'[second]} [mm]")
    return Picture("contact", plots.png(figure))
