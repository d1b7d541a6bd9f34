"""Selection of the modes that a reduction keeps."""

from typing import NamedTuple

import numpy as np

from beadwave.rom.contact_space import Space
from beadwave.rom.factorisation import ReductionError


class Selection(NamedTuple):
    """Number of modes, the rule that chooses them, and their highest frequency.

    Give n_modes, or cutoff_hz [Hz] for all modes below it, or error and to_hz [Hz] for the fewest
    that keep the receptance at the contact to a relative rms error up to that frequency; with to_hz
    the result states its error. choice "lowest" takes the modes in the order of their frequencies,
    "contact" those that matter most at the contact up to to_hz (see rom.contact_modes).
    modes = (omega (k,) [rad/s], phi (n, k) mass-normalised) are modes that are already there:
    "lowest" cuts them to the number or cutoff, "contact" keeps them all. With finer_hz the result
    carries a finer model that stands for the full one up to there. space is a Krylov space of this
    contact that is already there, with those modes among its pairs: "contact" chooses from it.
    """

    n_modes: int | None = None
    cutoff_hz: float | None = None
    error: float | None = None
    to_hz: float | None = None
    choice: str = "lowest"
    modes: tuple[np.ndarray, np.ndarray] | None = None
    finer_hz: float | None = None
    space: Space | None = None

    @property
    def by_contact(self) -> bool:
        """True if the contact chooses the modes."""
        return self.choice == "contact"


def require_selection(selection: Selection, *, modes_suffice: bool = False) -> None:
    """Raise ReductionError unless the modes are chosen in one way, and in a way that is known.

    modes_suffice: modes that are handed in may stand without a number, a cutoff or an error.
    """
    n_modes, cutoff_hz, error, to_hz, choice, modes, *_ = selection
    choices = sum(number is not None for number in (n_modes, cutoff_hz, error))
    if choices > 1 or (choices == 0 and not (modes_suffice and modes is not None)):
        raise ReductionError("give one of n_modes, cutoff_hz or error to say which modes to keep.")
    if error is not None and (to_hz is None or not (0 < error < 1)):
        raise ReductionError(
            f"error={error:g} with to_hz={to_hz}: an error lies between 0 and 1 and "
            f"needs the frequency to_hz up to which it holds."
        )
    if choice not in ("lowest", "contact"):
        raise ReductionError(f"choice is {choice!r}; it can be 'lowest' or 'contact'.")
    if selection.by_contact and (to_hz is None or (n_modes is None and not error)):
        raise ReductionError(
            "choice 'contact' needs n_modes or error, and to_hz, the frequency up to which modes "
            "are to matter; a cutoff takes the lowest."
        )
