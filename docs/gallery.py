"""The gallery: a page for each study, with its picture and what it found.

Run it before the build: python docs/gallery.py; it writes docs/gallery/NAME.md and NAME.png.
"""

import re
import sys
from pathlib import Path

import beadwave

HERE = Path(__file__).parent / "gallery"

PAGE = """# {title}

{shows}

```sh
beadwave study {name}
```

```{{image}} {name}.png
:alt: {shows}
```

{found}
"""


def page(name: str, shows: str) -> None:
    """Write the page of a study; its paragraphs are those that the command prints."""
    found = beadwave.study(name)
    found.plot().save(HERE / f"{name}.png")
    title = name.replace("-", " ").capitalize()
    text = "\n\n".join(re.sub(r"([\\`*_\[\]<>$#|{}])", r"\\\1", said) for said in found.sentences)
    page = PAGE.format(title=title, shows=shows, name=name, found=text)
    (HERE / f"{name}.md").write_text(page, encoding="utf-8")


def main() -> None:
    """All studies, or those named on the command line."""
    HERE.mkdir(exist_ok=True)
    for name, shows in beadwave.studies().items():
        if name in sys.argv[1:] or not sys.argv[1:]:
            page(name, shows)


if __name__ == "__main__":
    main()
