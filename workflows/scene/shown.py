"""Values and words that a user gave, as sentences show them."""

import re
from typing import Any

LONGEST = 80  # characters of a value in a sentence
LONGEST_WORD = 250  # of a word of a sentence, as a path
WORD = re.compile(rf"\S{{{LONGEST_WORD + 1},}}")


def shown(value: Any) -> str:
    """A value as Python writes it, at most LONGEST characters of it."""
    try:
        text = " ".join(repr(value).split())
    except Exception:  # an object whose description fails, or is nested too deeply
        text = f"<{type(value).__name__}>"
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 3]}..."


def clipped(sentence: str) -> str:
    """A sentence whose words of more than LONGEST_WORD characters are cut."""
    return WORD.sub(lambda word: f"{word[0][:LONGEST_WORD]}...", sentence)
