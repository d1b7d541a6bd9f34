"""Values and words that a user gave, as sentences show them."""

import re
from typing import Any

LONGEST = 80  # characters of a value in a sentence
LONGEST_WORD = 250  # of a word without quotes, as a path
QUOTED = re.compile(rf"(['\"])((?:(?!\1).){{{LONGEST + 1},}})\1", re.S)
WORD = re.compile(rf"\S{{{LONGEST_WORD + 1},}}")


def shown(value: Any) -> str:
    """A value as Python writes it, at most LONGEST characters of it."""
    try:
        text = " ".join(repr(value).split())
    except Exception:  # an object whose description fails, or is nested too deeply
        text = f"<{type(value).__name__}>"
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 3]}..."


def clipped(sentence: str) -> str:
    """A sentence whose long quoted texts and long words are cut."""
    sentence = QUOTED.sub(lambda text: f"{text[1]}{text[2][: LONGEST - 3]}...{text[1]}", sentence)
    return WORD.sub(lambda word: f"{word[0][:LONGEST_WORD]}...", sentence)
