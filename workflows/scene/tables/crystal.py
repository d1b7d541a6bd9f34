"""[crystal]: spheres on a lattice, in a Y, or in a network of the user's, and what strikes them.

Places on a lattice count from 0: [column, row] in the plane, [column, column, layer] in space,
[number, part] in a Y, whose parts are the stem and the two branches, and [number] in a network, as
its file numbers the spheres. Rows follow each other from the struck side on.
"""

from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from beadwave.workflows.scene.named_files import FileName
from beadwave.workflows.scene.named_materials import of_named_material
from beadwave.workflows.scene.quantities import of
from beadwave.workflows.scene.scene_table import (
    Count,
    Density,
    Number,
    PatchRadius,
    Point,
    Poisson,
    Positive,
    Radius,
    SceneTable,
    Young,
)
from beadwave.workflows.scene.tables.shakers import Face
from beadwave.workflows.scene.units import FORCE, LENGTH, VELOCITY

PLANAR = ("square", "hexagonal")
LATTICES = (*PLANAR, "sc", "bcc", "fcc", "hcp", "y")
Index = Annotated[int, Field(ge=0, le=1_000_000)]
Site = Annotated[tuple[Index, ...], Field(strict=False, min_length=1, max_length=3)]


class Inclusion(SceneTable):
    """A sphere of another size or material at a place of the lattice."""

    at: Site  # place of the sphere, counted from 0
    radius: Radius | None = None  # [m] without it that of the others
    material: str | None = None  # a named material, in place of its numbers
    density: Density | None = None  # [kg/m^3] mass over volume
    young: Young | None = None  # [Pa] Young's modulus
    poisson: Poisson | None = None  # Poisson's ratio

    _of_named_material = of_named_material("density", "young", "poisson")


class Place(SceneTable):
    """Spheres that move of themselves: one `at` a place, or all of a `row` or `plane`."""

    at: Site | None = None  # place of one sphere, counted from 0
    row: Index | None = None  # all spheres of a row in the plane, 0 is the first
    plane: Index | None = None  # all spheres of a layer in space, 0 is the first
    # of the motion, x, y, z; without it along the rows' axis, or along the sphere's guide
    direction: Annotated[tuple[Number, Number, Number], Field(strict=False)] | None = None

    @model_validator(mode="after")
    def _one_place(self) -> "Place":
        if sum(value is not None for value in (self.at, self.row, self.plane)) != 1:
            raise ValueError("needs one of at, row and plane: say which spheres move")
        if self.direction is not None and not any(self.direction):
            raise ValueError("direction = [0, 0, 0] is none: give x, y, z of the motion")
        return self


class CrystalStriker(Place):
    """The spheres that move at the start: one `at` a place, or all of a `row` or `plane`."""

    velocity: of(Positive, VELOCITY, 0, 100)  # [m/s] towards the other spheres


class CrystalDrive(Place):
    """Spheres whose motion is given by a CSV: time [us] and the quantity with its unit."""

    quantity: Literal["displacement", "velocity", "acceleration"]  # that the file holds
    file: FileName  # CSV of time [us], displacement [um]; units stand in its header


class CrystalTable(SceneTable):
    """Spheres in space that touch their neighbours: a `lattice` of a `size`, or a network of
    `nodes` and `links` from files.

    nodes.csv has the columns sphere, x [m], y [m], z [m], radius [m], guide_x, guide_y, guide_z: a
    guide leaves a sphere the motion along it, 0, 0, 0 leaves all. links.csv has first, second, the
    numbers of two spheres.
    """

    # square and hexagonal lie in the plane x, y; sc, bcc, fcc, hcp in space; y is a stem that
    # splits into two branches
    lattice: Literal[LATTICES] | None = None
    # columns and rows; in space columns along x and y, and layers; of a y stem and branch
    size: Annotated[tuple[Count, ...], Field(strict=False, min_length=2, max_length=3)] | None = (
        None
    )
    # [degrees] from the line of a y's stem to a branch
    half_angle: Annotated[float, Field(gt=0, le=90)] | None = None
    nodes: FileName | None = None  # a CSV of the spheres of a network, in place of a lattice
    links: FileName | None = None  # a CSV of the pairs of its spheres that touch
    radius: Radius | None = None  # [m] of the spheres of a lattice
    material: str | None = None  # a named material, in place of its numbers
    density: Density  # [kg/m^3] mass over volume
    young: Young  # [Pa] Young's modulus
    poisson: Poisson  # Poisson's ratio
    sides: Literal["free", "periodic", "rigid"] = "free"  # of a lattice, beside its rows
    missing: Annotated[tuple[Site, ...], Field(strict=False)] = ()  # places without a sphere
    inclusions: Annotated[tuple[Inclusion, ...], Field(strict=False)] = ()  # other spheres
    # standard deviation of the radii over the radius; rows are then so far apart that none press
    scatter: Annotated[float, Field(ge=0, le=0.1)] = 0.0
    seed: Annotated[int, Field(ge=0, lt=2**63)] = 0  # of the scatter
    # [m] overlap of the contacts at rest, held by a plane before the first row that stands still
    precompression: of(Positive, LENGTH, 0, 1e-3) | None = None
    # [N] in place of it: a steady force, an equal share on each sphere of the first row
    force: of(Positive, FORCE, 0, 1e6) | None = None
    # the plane face of [assembly] that its last row leans on, "body:+x"
    on: Face | None = None
    # [m] of the middle of that row, from the middle of the face along its two global axes
    at: Point = (0.0, 0.0)
    patch_radius: PatchRadius = 2e-3  # [m] of the patch under each sphere of that row
    striker: CrystalStriker | None = None  # what moves at the start
    drive: CrystalDrive | None = None  # spheres that are moved, a shaken row

    _of_named_material = of_named_material("density", "young", "poisson")

    @model_validator(mode="before")
    @classmethod
    def _one_shape(cls, table: Any) -> Any:
        """A lattice with all that it needs, or a network with both of its files."""
        if not isinstance(table, dict):
            return table
        given = {key for key in table if table[key] is not None}
        network = given & {"nodes", "links"}
        if network and len(network) < 2:
            raise ValueError("nodes and links belong together: give both files")
        if network and (extra := sorted(given & {"lattice", "size", "radius", "half_angle"})):
            raise ValueError(f"{extra[0]} is of a lattice, nodes of a network: keep one of them")
        if not network and (
            missing := [k for k in ("lattice", "size", "radius") if k not in given]
        ):
            raise ValueError(f"needs {missing[0]}, or nodes and links of a network: add it")
        if (table.get("lattice") == "y") != ("half_angle" in given) and not network:
            raise ValueError('half_angle and lattice = "y" belong together: give both')
        return table

    @property
    def dimensions(self) -> int:
        """Numbers of a place."""
        if self.nodes:
            return 1
        return 2 if self.lattice in (*PLANAR, "y") else 3

    @property
    def n_sites(self) -> int | None:
        """Places of the lattice; None for a network."""
        if self.nodes:
            return None
        if self.lattice == "y":
            return self.size[0] + 2 * self.size[1]
        n = 1
        for count in self.size:
            n *= count
        return n
