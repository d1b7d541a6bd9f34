"""The gallery: a page for each study, with its picture, its tables and what it found.

`python docs/gallery.py` computes all again, `python docs/gallery.py striker walls` two of them; it
writes docs/gallery/NAME.md and NAME.png, which are kept with the sources, and their list index.md
with a tile of each, the first panel of its picture.
"""

import re
import sys
from io import BytesIO
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

import beadwave
from beadwave.workflows.report import tables

HERE = Path(__file__).parent / "gallery"

PAGE = """# {title}

{shows}

```sh
beadwave study {name}
```

```{{image}} {name}.png
:alt: {shows}
:target: ../_images/{name}.png
```

{found}

{tables}
"""
TABLE = """```text
{}
```"""
INDEX = """# Gallery

Each study computes figures and statements of the [thesis](../thesis.md), or of structures like
its own, and says what holds. A page is what its command prints and draws:
`python docs/gallery.py NAME` makes it again.

```{{toctree}}
:hidden:
:maxdepth: 1

{names}
```

::::{{container}} tiles
{entries}
::::
"""
ENTRY = """:::{{container}} tile
[![{title}](tiles/{name}.png)]({name}.md)

**[{title}]({name}.md)**

{shows}
:::"""


def page(name: str, shows: str) -> None:
    """Write the page of a study; its tables and paragraphs are those that the command prints."""
    finding = beadwave.study(name)
    (HERE / f"{name}.png").write_bytes(small(Image.open(BytesIO(finding.plot().png))))
    text = "\n\n".join(map(plain, finding.sentences))
    printed = [tables.text(table) for table in finding.tables if table.printed != ()]
    listed = "\n\n".join(map(TABLE.format, printed))
    page = PAGE.format(title=title(name), shows=shows, name=name, found=text, tables=listed)
    (HERE / f"{name}.md").write_text(page.rstrip() + "\n", encoding="utf-8")


def plain(sentence: str) -> str:
    """A sentence whose signs mean nothing to Markdown, code apart."""
    return re.sub(r"(`[^`]+`)|([\\`*_\[\]<>$#|{}])", lambda m: m[1] or f"\\{m[2]}", sentence)


def title(name: str) -> str:
    """As a heading."""
    return name.replace("-", " ").capitalize()


def small(picture: Image.Image) -> bytes:
    """PNG of a picture in 256 colours, a third of the bytes."""
    written = BytesIO()
    picture.convert("RGB").quantize(256, dither=0).save(written, "png", optimize=1)
    return written.getvalue()


def first_panel(picture: Image.Image) -> Image.Image:
    """The first of a picture's panels in rows and columns, with its labels, for a tile."""
    inked = np.asarray(picture.convert("L")) < 235

    # what follows the first panel in its row is the label of the next one
    columns = stretches(inked.any(axis=0))
    wide = [i for i, (first, end) in enumerate(columns) if end - first > 0.12 * picture.width]
    width = picture.width
    if len(wide) > 1:
        width = (columns[wide[0]][1] + columns[wide[0] + 1][0]) // 2

    # below it are numbers and the label of its axis, then the title of the next one
    rows = stretches(inked[:, :width].any(axis=1))
    high = [i for i, (first, end) in enumerate(rows) if end - first > 0.1 * picture.height]
    height = picture.height
    if len(high) > 1:
        title = max(high[1] - 1, high[0] + 1)
        height = (rows[title - 1][1] + rows[title][0]) // 2
    return picture.crop((0, 0, width, height))


def stretches(inked: NDArray[np.bool_], gap: int = 6) -> list[tuple[int, int]]:
    """First and end of what is inked, blanks of less than `gap` pixels between letters included."""
    changes = np.flatnonzero(np.diff(inked, prepend=False, append=False)).tolist()
    joined: list[tuple[int, int]] = []
    for first, end in zip(changes[::2], changes[1::2], strict=True):
        if joined and first - joined[-1][1] < gap:
            first = joined.pop()[0]
        joined.append((first, end))
    return joined


def index(studies: dict[str, str]) -> None:
    """Write the list of the pages that are there."""
    there = {name: shows for name, shows in studies.items() if (HERE / f"{name}.md").is_file()}
    entries = []
    (HERE / "tiles").mkdir(exist_ok=True)
    for name, shows in there.items():
        tile = first_panel(Image.open(HERE / f"{name}.png").convert("RGB"))
        (HERE / "tiles" / f"{name}.png").write_bytes(small(tile))
        entries.append(ENTRY.format(title=title(name), name=name, shows=shows))
    text = INDEX.format(names="\n".join(there), entries="\n\n".join(entries))
    (HERE / "index.md").write_text(text, encoding="utf-8")


def main() -> None:
    """All studies, or those named on the command line."""
    HERE.mkdir(exist_ok=True)
    studies = beadwave.studies()
    for name, shows in studies.items():
        if name in sys.argv[1:] or not sys.argv[1:]:
            page(name, shows)
    index(studies)


if __name__ == "__main__":
    main()
