"""CalculiX (Debian: calculix-ccx) on an input deck: results of an independent program.

Its element C3D20 has the 27 Gauss points of the hexahedra here; its C3D10 integrates masses with 4
points, exactly to order 2 only, so that frequencies of tetrahedra differ by up to 3e-4.
"""

from pathlib import Path
from subprocess import run
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix, csr_matrix

from beadwave.fem.exchange.deck import PRINT_CONTACT, Deck

PROGRAM, PACKAGE = "ccx", "calculix-ccx"


class DeckResults(NamedTuple):
    """Results of CalculiX for a deck that `fem.exchange.abaqus` wrote."""

    frequency_hz: NDArray[np.float64]  # (n_modes,)
    compliance: float | None  # [m/N] at the contact, where the deck has one


class Matrices(NamedTuple):
    """K and M as CalculiX assembled them, on the dofs that it solves for."""

    K: csr_matrix  # (n, n) [N/m]
    M: csr_matrix  # (n, n) [kg]
    dof: NDArray[np.int64]  # (n,) 3 (node - 1) + direction, with directions 0, 1, 2


def answer(deck: str) -> DeckResults:
    """Frequencies (n_modes,) [Hz] and static compliance [m/N] of a deck's text; raises ValueError
    where CalculiX gives none."""
    with TemporaryDirectory() as folder:
        _run(Path(folder), deck)
        text = (Path(folder) / "deck.dat").read_text(encoding="utf-8", errors="replace")
    rows = [line.split() for line in text.splitlines()]
    hz = [float(row[3]) for row in rows if len(row) == 5 and row[0].isdigit()]
    if not hz:
        raise ValueError("CalculiX found no frequencies in this deck.")
    printed = text.partition("set CONTACT")[2].split()
    compliance = float(printed[printed.index("time") + 3]) if printed else None
    return DeckResults(np.array(hz), compliance)


def matrices(deck: str) -> Matrices:
    """K and M of a deck with a step *FREQUENCY; raises ValueError where CalculiX writes none."""
    with TemporaryDirectory() as folder:
        _run(Path(folder), deck.replace("*FREQUENCY\n", "*FREQUENCY, SOLVER=MATRIXSTORAGE\n"))
        full = []
        for ending in ("sti", "mas"):
            # rows "i j value" of one triangle
            row, column, value = np.loadtxt(Path(folder) / f"deck.{ending}", unpack=True, ndmin=2)
            i, j = row.astype(int) - 1, column.astype(int) - 1
            off = i != j
            both = np.append(i, j[off]), np.append(j, i[off])
            full.append(coo_matrix((np.append(value, value[off]), both)).tocsr())
        names = (Path(folder) / "deck.dof").read_text(encoding="utf-8", errors="replace").split()
    node, direction = np.array([name.split(".") for name in names], int).T
    return Matrices(*full, 3 * (node - 1) + direction - 1)


def receptance(
    deck: str, *, n_modes: int, zeta: float, span_hz: tuple[float, float]
) -> tuple[NDArray[np.float64], NDArray[np.complex128]]:
    """Frequencies (k,) [Hz] and displacement per force H (k,) [m/N] at the contact of a deck that
    has one, of its first modes with a damping ratio, by *STEADY STATE DYNAMICS.

    CalculiX chooses the frequencies: both ends of span_hz, the natural frequencies and points
    between them. Raises ValueError where it gives up on the deck.
    """
    node = deck.partition("*CLOAD\n")[2].partition(",")[0]
    low, high = span_hz
    between = 4  # points of the response between two natural frequencies
    steps = Deck()
    steps.step("*FREQUENCY, STORAGE=YES", f"{n_modes}")
    steps.step(
        "*STEADY STATE DYNAMICS", f"{low}, {high}, {between}, 1.",
        "*MODAL DAMPING", f"1, {n_modes}, {zeta}", "*CLOAD", f"{node}, 1, 1.0", *PRINT_CONTACT,
    )  # fmt: skip
    with TemporaryDirectory() as folder:
        _run(Path(folder), deck.partition("*STEP\n")[0] + steps.text())
        text = (Path(folder) / "deck.dat").read_text(encoding="utf-8", errors="replace")
    rows = [block.split() for block in text.split("set CONTACT and time")[1:]]
    f, u = np.array([[float(row[0]), float(row[2])] for row in rows]).T
    return f[::2], u[::2] + 1j * u[1::2]


def _run(folder: Path, deck: str, *, seconds: float = 600.0) -> None:
    """Run the deck in a folder; raises ValueError where CalculiX gives up on it."""
    (folder / "deck.inp").write_text(deck, encoding="utf-8", newline="\n")
    ended = run(
        [PROGRAM, "deck"],
        cwd=folder,
        capture_output=True,
        encoding="utf-8",
        errors="replace",
        timeout=seconds,
        check=False,
    )
    errors = [line for line in ended.stdout.splitlines() if line.startswith(" *ERROR")]
    if ended.returncode not in (0, 201) or errors:
        why = errors[0] if errors else f"status {ended.returncode}"
        raise ValueError(f"CalculiX gives up on this deck: {why.strip()}")
