"""The gallery: a page for each study, with its picture, its tables and what it found.

`python docs/gallery.py` computes all again, `python docs/gallery.py striker walls` two of them; it
writes docs/gallery/NAME.md and NAME.png, which are kept with the sources, and their list index.md.
"""

import re
import sys
from io import BytesIO
from pathlib import Path

from PIL import Image

import beadwave
from workflows.report import tables

HERE = Path(__file__).parent / "gallery"
ASPECT = 1.18  # of a tile's picture, width over height, in static/site.css
VIEWS = {"one-panel": 1.0, "two-panels": 1.5, "three-panels": 2.8}  # enlargement in a tile

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
ENTRY = """:::{{container}} tile {view}
[![{title}]({name}.png)]({name}.md)

**[{title}]({name}.md)**

{shows}
:::"""


def page(name: str, shows: str) -> None:
    """Write the page of a study; its tables and paragraphs are those that the command prints."""
    finding = beadwave.study(name)
    (HERE / f"{name}.png").write_bytes(small(finding.plot().png))
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


def small(png: bytes) -> bytes:
    """The picture in 256 colours, a third of the bytes."""
    written = BytesIO()
    Image.open(BytesIO(png)).convert("RGB").quantize(256, dither=0).save(written, "png", optimize=1)
    return written.getvalue()


def view(name: str) -> str:
    """How much of a picture its tile shows, a class of static/site.css: a single panel whole, else
    about the first of two or three in a row, which are some 700 and 570 pixels wide."""
    width, height = Image.open(HERE / f"{name}.png").size
    columns = 1 if width < 1100 else 2 if width < 1500 else 3
    # width of the picture that a tile which it fills shows before it is enlarged
    visible = min(width, ASPECT * height)
    enlarged = visible / (width / columns)
    return "whole" if columns == 1 else min(VIEWS, key=lambda view: abs(VIEWS[view] - enlarged))


def index(studies: dict[str, str]) -> None:
    """Write the list of the pages that are there."""
    there = {name: shows for name, shows in studies.items() if (HERE / f"{name}.md").is_file()}
    entries = [
        ENTRY.format(title=title(n), name=n, shows=shows, view=view(n))
        for n, shows in there.items()
    ]
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
