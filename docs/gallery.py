"""The gallery: a page for each script of examples/gallery, with its picture and what it prints.

`python docs/gallery.py` runs all again, `python docs/gallery.py striker walls` two of them; it
writes docs/gallery/NAME.md and NAME.png, which are kept with the sources, and their list index.md
with a tile of each, the first panel of its picture. Text and source of a page are the script's.
"""

import ast
import re
import subprocess
import sys
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import NDArray
from PIL import Image

HERE = Path(__file__).parent / "gallery"
SCRIPTS = Path(__file__).parents[1] / "examples" / "gallery"

PAGE = """# {title}

{text}

```console
{calls}
```

```{{image}} {name}.png
:alt: {shows}
:target: ../_images/{name}.png
```

```text
{printed}
```

## The script

```{{literalinclude}} ../../examples/gallery/{script}
:language: python
```
"""
INDEX = """# Gallery

Each script computes figures and statements of the [thesis](../thesis.md), or of structures like
its own, and says what holds. A page is what its script prints and draws:
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


def scripts() -> dict[str, Path]:
    """The scripts by the names of their pages, without the modules that they share."""
    files = sorted(SCRIPTS.glob("*.py"))
    return {
        file.stem.replace("_", "-"): file
        for file in files
        if 'if __name__ == "__main__"' in file.read_text(encoding="utf-8")
    }


def docstring(script: Path) -> tuple[str, list[str], list[str]]:
    """Summary of a script in a sentence, the paragraphs about it, and the lines that run it."""
    paragraphs = (ast.get_docstring(ast.parse(script.read_text(encoding="utf-8"))) or "").split(
        "\n\n"
    )
    (run,) = (text for text in paragraphs if text.startswith("Run it: "))
    calls = [line.strip() for line in run.removeprefix("Run it: ").splitlines()]
    return paragraphs[0], [text for text in paragraphs[1:] if text != run], calls


def ran(script: Path) -> tuple[str, Image.Image]:
    """Text and picture of a script, run whole in a folder of its own."""
    with TemporaryDirectory() as folder:
        done = subprocess.run(
            [sys.executable, script], cwd=folder, check=True, stdout=subprocess.PIPE, text=True
        )
        picture = Image.open(Path(folder, f"{script.stem}.png")).convert("RGB")
    return done.stdout, picture


def page(name: str, script: Path, printed: str, picture: Image.Image) -> None:
    """Write the page of a script with what it printed and drew."""
    (HERE / f"{name}.png").write_bytes(small(picture))
    shows, about, calls = docstring(script)
    # what is indented is a formula
    text = "\n\n".join(t if t.startswith("    ") else plain(t) for t in (shows, *about))
    page = PAGE.format(
        title=title(name), shows=" ".join(shows.split()), text=text, name=name,
        calls="\n".join(calls), printed=printed.strip("\n"), script=script.name,
    )  # fmt: skip
    (HERE / f"{name}.md").write_text(page, encoding="utf-8")


def plain(sentence: str) -> str:
    """A text whose signs mean nothing to Markdown, code apart."""
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


def index(names: dict[str, Path]) -> None:
    """Write the list of the pages that are there."""
    there = [name for name in names if (HERE / f"{name}.md").is_file()]
    entries = []
    (HERE / "tiles").mkdir(exist_ok=True)
    for name in there:
        tile = first_panel(Image.open(HERE / f"{name}.png").convert("RGB"))
        (HERE / "tiles" / f"{name}.png").write_bytes(small(tile))
        shows = plain(" ".join(docstring(names[name])[0].split()))
        entries.append(ENTRY.format(title=title(name), name=name, shows=shows))
    text = INDEX.format(names="\n".join(there), entries="\n\n".join(entries))
    (HERE / "index.md").write_text(text, encoding="utf-8")


def main() -> None:
    """All scripts, or those named on the command line."""
    HERE.mkdir(exist_ok=True)
    names = scripts()
    for name, script in names.items():
        if name in sys.argv[1:] or not sys.argv[1:]:
            page(name, script, *ran(script))
    index(names)


if __name__ == "__main__":
    main()
