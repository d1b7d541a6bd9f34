"""The text of a STEP file: whether it is whole, its unit, and names of solids and faces.

ISO 10303-21 (the file), ISO 10303-41 (units: SI_UNIT with a prefix, CONVERSION_BASED_UNIT).
"""

import re
from collections.abc import Iterator
from pathlib import Path

from geometry.errors import InvalidGeometry

PREFIXES = {"MILLI": "mm", "CENTI": "cm", "DECI": "dm", "MICRO": "um", "KILO": "km", "$": "m"}
CONVERTED = re.compile(r"CONVERSION_BASED_UNIT\s*\(\s*'([^']*)'\s*,[^)]*\)\s*LENGTH_UNIT", re.I)
SI = re.compile(r"SI_UNIT\s*\(\s*\.?(\$|\w+)\.?\s*,\s*\.METRE\.\s*\)", re.I)

WRITTEN = re.compile(r"'Open CASCADE STEP translator [\d.]+ \d+(?:\.(\d+))?'")

NAMED_FACE = re.compile(r"ADVANCED_FACE\s*\(\s*'(?!NONE')[^']")
ENTITY = re.compile(r"#(\d+)\s*=\s*(\w+)\s*\((.*?)\)\s*;", re.S)
SOLIDS = ("MANIFOLD_SOLID_BREP", "BREP_WITH_VOIDS")
REFERENCE = re.compile(r"#(\d+)")
TEXTS = re.compile(rb"'[^']*'|/\*.*?\*/|\s+", re.S)  # a doubled apostrophe ends and begins one
DEFINED, REFERRED = re.compile(rb"#(\d+)="), re.compile(rb"#(\d+)")


def check_step(path: Path) -> None:
    """Raises InvalidGeometry for a file that is missing, empty, damaged, or no STEP file."""
    if not path.is_file():
        why = "is no ordinary file" if path.exists() else "does not exist"
        script = path.with_suffix(".py")
        remedy = f"draw it first: python {script}" if script.is_file() else "give a STEP file"
        raise InvalidGeometry(f"{path} {why}; {remedy}.")
    content = path.read_bytes()
    if not content.strip():
        raise InvalidGeometry(f"{path} is empty; export the bodies as STEP again.")
    if not content.lstrip().startswith(b"ISO-10303-21"):
        raise InvalidGeometry(f"{path} is no STEP file: it does not begin with ISO-10303-21.")
    if b"END-ISO-10303-21" not in content[-1000:]:
        raise InvalidGeometry(f"{path} is cut off before END-ISO-10303-21; export it again.")
    bare = TEXTS.sub(b"", content)
    defined = set(DEFINED.findall(bare))
    missing = next((n for n in REFERRED.findall(bare) if n not in defined), None)
    if missing:
        raise InvalidGeometry(
            f"{path} is damaged: it refers to #{missing.decode()}, which it does not hold; export "
            "it again."
        )


def n_solids(path: Path) -> int:
    """Number of solids that the file describes; one that it places several times counts once."""
    bare = TEXTS.sub(b"", path.read_bytes())
    return sum(bare.count(b"%s(" % kind.encode()) for kind in SOLIDS)


def unit(path: Path) -> str:
    """The unit of the file's lengths, "mm" or "inch" for example; "mm" where it names none."""
    text = path.read_text(encoding="latin-1")
    converted = CONVERTED.search(text)
    if converted:
        return converted[1].lower()
    metric = SI.search(text)
    return PREFIXES.get(metric[1].upper(), metric[1].lower()) if metric else "mm"


def face_names(path: Path) -> list[list[str]]:
    """Names of the faces of every solid in the file, "" for a face without; an empty list where no
    face has a name."""
    text = path.read_text(encoding="latin-1")
    if not NAMED_FACE.search(text):
        return []
    entities = {number: (kind, inside) for number, kind, inside in ENTITY.findall(text)}
    solids = [inside for kind, inside in entities.values() if kind in SOLIDS]
    names = []
    for solid in solids:
        faces = [face.lstrip()[1:].partition("'")[0] for face in _faces(solid, entities)]
        names.append(["" if name == "NONE" else name for name in faces])
    return names


def _faces(inside: str, entities: dict[str, tuple[str, str]]) -> Iterator[str]:
    """Names of the faces of a solid, a shell or an oriented shell, in the order of the file."""
    for number in REFERENCE.findall(inside):
        kind, content = entities.get(number, ("", ""))
        if kind == "ADVANCED_FACE":
            yield content
        elif kind.endswith("CLOSED_SHELL"):
            yield from _faces(content, entities)


def name_solids(path: Path, names: list[str]) -> None:
    """Writes names, in their order, in place of the numbered ones that OpenCASCADE gives solids."""
    text = path.read_text(encoding="latin-1")

    def named(match: re.Match) -> str:
        if match[1] is None and len(names) > 1:
            return "'assembly'"
        return "'{}'".format(names[int(match[1] or 1) - 1].replace("'", "''"))

    path.write_text(WRITTEN.sub(named, text), encoding="latin-1")
