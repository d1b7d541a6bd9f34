"""The sets of cells that are bodies, of those that a mesh file has.

Files list sets for many ends: bodies, everything, cells for output. The bodies are the smallest
family of sets in which each cell is once (Knuth's exact cover, arXiv cs/0011047, by the number of
sets), of two equal sets the one that somebody named.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from beadwave.geometry.errors import InvalidGeometry
from beadwave.geometry.own_mesh.cell_groups import Origin

# sets that are tried for one cell or another before a choice is asked for; 40 random sets over 12
# bodies took at most 3000
MOST_TRIALS = 200_000


class CellSet(NamedTuple):
    """A named set of cells."""

    name: str
    origin: Origin
    cells: NDArray[np.int64]  # numbers, each once


def bodies_of(sets: Mapping[str, CellSet], source: str) -> list[str]:
    """Names of the sets that are bodies, in the order of the file. Sets without a name count where
    none has one. Raises InvalidGeometry where no family has each cell once, and where two smallest
    families divide the cells otherwise."""
    named = {n: s for n, s in sets.items() if s.origin != Origin.NUMBER} or dict(sets)

    # equal sets are one, under the better name
    equal: dict[bytes, str] = {}
    for name, one in sorted(named.items(), key=lambda item: item[1].origin):
        equal.setdefault(np.sort(one.cells).tobytes(), name)
    names = [name for name in named if name in equal.values()]

    # atoms: cells that are in the same sets; by atom the sets it is in
    cells = np.unique(np.concatenate([named[n].cells for n in names]))
    inside = np.array([np.isin(cells, named[n].cells) for n in names]).T
    atoms = np.unique(inside, axis=0)
    if atoms.sum(axis=1).max() == 1:
        return names

    families = _covers(atoms)
    best = {
        tuple(sorted(family)): sum(named[names[i]].origin for i in family) for family in families
    }
    if not best:
        counts = inside.sum(axis=1)
        two = [names[i] for i in np.flatnonzero(inside[counts > 1][0])[:2]]
        raise InvalidGeometry(
            f"the mesh {source!r} has {int((counts > 1).sum())} cells in two volumes, as "
            f"{two[0]!r} and {two[1]!r}, and no choice of its sets has each cell once; put each "
            f"cell in one, or name the bodies: assembly.volumes = {names[:2]}."
        )
    least = min(best.values())
    choices = sorted(family for family, rank in best.items() if rank == least)
    if len(choices) > 1:
        first, second = ([names[i] for i in family] for family in choices[:2])
        raise InvalidGeometry(
            f"the mesh {source!r} has sets that overlap, and {first} as well as {second} have each "
            f"cell once; say which are the bodies: assembly.volumes = {first}."
        )
    return [names[i] for i in sorted(choices[0])]


def _covers(atoms: NDArray[np.bool_]) -> list[list[int]]:
    """All smallest families of columns in which every row (atoms, sets) is once; an empty list for
    none, or where MOST_TRIALS do not find them all."""
    meets = atoms.T.astype(int) @ atoms.astype(int) > 0  # sets with an atom in common
    best: list[list[int]] = []
    trials = 0
    stack = [([], np.ones(len(atoms), bool), np.ones(atoms.shape[1], bool))]
    while stack:
        family, open_atoms, free = stack.pop()
        if not open_atoms.any():
            if best and len(family) < len(best[0]):
                best = []
            best.append(family)
            continue
        if best and len(family) >= len(best[0]):
            continue
        # the atom with the fewest sets that may still have it
        choices = atoms & free
        open_rows = np.flatnonzero(open_atoms)
        row = open_rows[choices[open_rows].sum(axis=1).argmin()]
        for one in np.flatnonzero(choices[row]):
            trials += 1
            if trials > MOST_TRIALS:
                return []
            stack.append(([*family, int(one)], open_atoms & ~atoms[:, one], free & ~meets[one]))
    return best
