"""The text of an input deck for Abaqus or CalculiX, keyword by keyword.

Both read the same keywords; what differs between our decks are options of `Deck`. A label has up to
60 letters (CalculiX reads 80), a coordinate up to 20 characters.
"""

from collections.abc import Iterable, Sequence

from beadwave.fem.assembly.materials import Material, Orthotropic

Term = tuple[int, int, float | str]  # node, direction from 1, factor; a text is written as it is
PRINT_CONTACT = ("*NODE PRINT, NSET=CONTACT", "U")


class Deck:
    """Lines of a deck, in the order in which they are added."""

    def __init__(
        self, *comments: str, per_line: int | None = 10, terms: int = 4, number: str = ".12g"
    ) -> None:
        """per_line: numbers of an element in a line (None: all); terms: those of an equation in a
        line; number: the format of material constants."""
        self.lines = [f"** {comment}" for comment in comments]
        self.last_element = 0
        self._per_line, self._terms, self._number = per_line, terms, number

    def text(self) -> str:
        """The deck so far."""
        return "\n".join(self.lines) + "\n"

    def nodes(
        self,
        numbers: Iterable[int],
        points: Iterable[Sequence[float]],
        nset: str = "",
        *,
        number: str = ".13g",
    ) -> None:
        """Nodes at points (n, 3) [m] by their numbers (n,) from 1; their set, where it is named."""
        self.lines.append(f"*NODE, NSET={nset}" if nset else "*NODE")
        for i, (x, y, z) in zip(numbers, points, strict=False):
            self.lines.append(f"{i}, {x:{number}}, {y:{number}}, {z:{number}}")

    def elements(
        self, kind: str, elset: str, nodes: Iterable[Iterable[int]], first: int | None = None
    ) -> None:
        """Elements of one kind, by the numbers of their nodes (n, k) in the program's order,
        numbered from `first` on, else from the last one added."""
        self.lines.append(f"*ELEMENT, TYPE={kind}, ELSET={elset}")
        number = self.last_element if first is None else first - 1
        for cell in nodes:
            number += 1
            row = [str(n) for n in (number, *cell)]
            step = self._per_line or len(row)
            for i in range(0, len(row), step):
                continuation = "," if i + step < len(row) else ""
                self.lines.append(", ".join(row[i : i + step]) + continuation)
        self.last_element = max(self.last_element, number)

    def boundary(self, rows: Iterable[tuple[int, ...]]) -> None:
        """Directions that are held: (node, direction) or (node, first direction, last one)."""
        self.lines.append("*BOUNDARY")
        self.lines += [", ".join(map(str, row)) for row in rows]

    def equation(self, terms: Sequence[Term]) -> None:
        """sum of factor times displacement = 0; the first is the one eliminated."""
        self.lines += ["*EQUATION", str(len(terms))]
        rows = [
            f"{node}, {direction}, {c if isinstance(c, str) else f'{c:.12e}'}"
            for node, direction, c in terms
        ]
        for i in range(0, len(rows), self._terms):
            self.lines.append(", ".join(rows[i : i + self._terms]))

    def spring(
        self, name: str, nodes: Sequence[int], direction: int, k: float, number: int | None = None
    ) -> None:
        """A spring [N/m] of a node to the ground, or between two nodes, along a direction from 1
        of each; SPRING1 and SPRING2 act along global axes wherever their nodes are."""
        self.elements(f"SPRING{len(nodes)}", name, [nodes], number)
        directions = ", ".join([str(direction)] * len(nodes))
        self.lines += [f"*SPRING, ELSET={name}", directions, f"{k:.12e}"]

    def dashpot(self, name: str, nodes: Sequence[int], c: float, number: int) -> None:
        """A damper [N s/m] along the line between two nodes, which must not coincide."""
        self.elements("DASHPOTA", name, [nodes], number)
        self.lines += [f"*DASHPOT, ELSET={name}", "", f"{c:.12e}"]

    def mass(self, name: str, node: int, m: float, number: int) -> None:
        """A point mass [kg]."""
        self.elements("MASS", name, [[node]], number)
        self.lines += [f"*MASS, ELSET={name}", f"{m:.12e}"]

    def material(self, name: str, material: Material | Orthotropic) -> None:
        """The material of all elements of the set of that name."""
        form, oriented = self._number, ""
        self.lines.append(f"*MATERIAL, NAME={name}")
        if isinstance(material, Material):
            self.lines += ["*ELASTIC", f"{material.young:{form}}, {material.poisson:{form}}"]
        else:
            self.lines.append("*ELASTIC, TYPE=ENGINEERING CONSTANTS")
            values = (*material.young, *material.poisson, *material.shear)
            constants = [f"{x:{form}}" for x in values]
            self.lines += [", ".join(constants[:8]), constants[8]]
            oriented = f", ORIENTATION=AXES_{name}"
        self.lines += ["*DENSITY", f"{material.density:{form}}"]
        if isinstance(material, Orthotropic):
            axes = ", ".join(f"{x:{form}}" for x in material.frame[:2].ravel())
            self.lines += [f"*ORIENTATION, NAME=AXES_{name}", axes]
        self.lines.append(f"*SOLID SECTION, ELSET={name}, MATERIAL={name}{oriented}")

    def step(self, *lines: str) -> None:
        """A step: what is computed, loaded and printed."""
        self.lines += ["*STEP", *lines, "*END STEP"]


def labels(bodies: Iterable[str]) -> dict[str, str]:
    """Names of bodies in letters that decks allow, numbered where they would become equal."""
    label: dict[str, str] = {}
    for body in sorted(bodies):
        spelt = body.upper().replace("+", "_P_").replace("-", "_M_")
        letters = "".join(c if c.isalnum() and c.isascii() else "_" for c in spelt)[:60]
        label[body] = f"{letters}_{len(label)}" if letters in label.values() else letters
    return label
