"""Docstrings are plain text: tables in columns and what is indented are set as written."""

import re


def as_rst(lines: list[str]) -> list[str]:
    """The lines of a docstring for Sphinx."""
    found = []
    for paragraph in "\n".join(lines).split("\n\n"):
        own = paragraph.split("\n")
        if own[0].lstrip().startswith(">>>"):
            found += [*own, ""]
        elif any(line.startswith("  ") or "   " in line for line in own):
            found += ["::", "", *(f"    {line}" for line in own), ""]
        else:
            found += [*map(escaped, own), ""]
    return found


def escaped(line: str) -> str:
    """No word of the line is markup, but for what stands between backquotes."""
    parts = re.split(r"`([^`]+)`", line)
    plain = [re.sub(r"([*|\\]|_\b)", r"\\\1", part) for part in parts]
    return "".join(f"``{part}``" if i % 2 else plain[i] for i, part in enumerate(parts))
