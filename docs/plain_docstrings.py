"""Docstrings are plain text: what is indented is set as written, and columns of names and meanings,

    hammer  a hammer test, in columns or over
            several lines

as a list of them."""

import re

NAMED = re.compile(r"(\S(?:.*?\S)?) {2,}(\S.*)")  # a name and its meaning


def as_rst(lines: list[str]) -> list[str]:
    """The lines of a docstring for Sphinx."""
    rst = []
    for paragraph in "\n".join(lines).split("\n\n"):
        own = paragraph.split("\n")
        if own[0].lstrip().startswith(">>>"):
            rst += [*own, ""]
        elif meanings := named(own):
            for name, meaning in meanings:
                rst += [f"``{name}``", f"    {escaped(meaning)}", ""]
        elif any(line.startswith("  ") or "   " in line for line in own):
            rst += [".. code-block:: text", "", *(f"    {line}" for line in own), ""]
        else:
            rst += [*map(escaped, own), ""]
    return rst


def named(lines: list[str]) -> list[tuple[str, str]]:
    """Names and meanings of lines `name  meaning`, whose further lines begin below the meaning;
    empty where one of the lines is neither."""
    meanings: list[tuple[str, str]] = []
    column = 0
    for line in lines:
        indent = len(line) - len(line.lstrip())
        if meanings and indent == column:
            name, meaning = meanings.pop()
            meanings.append((name, f"{meaning} {line.strip()}"))
        elif not indent and (match := NAMED.fullmatch(line)):
            column = match.start(2)
            meanings.append((match[1], match[2]))
        else:
            return []
    # without the blanks that aligned further columns
    return [(name, re.sub(r" {2,}", " ", meaning)) for name, meaning in meanings]


def escaped(line: str) -> str:
    """No word of the line is markup, but for what stands between backquotes."""
    parts = re.split(r"`([^`]+)`", line)
    plain = [re.sub(r"([*|\\]|_\b)", r"\\\1", part) for part in parts]
    return "".join(f"``{part}``" if i % 2 else plain[i] for i, part in enumerate(parts))
