"""The text of a STEP file: whether it is whole, its unit, and names of solids and faces.

ISO 10303-21 (the file, and the control directives of its strings), ISO 10303-41 (units: SI_UNIT
with a prefix, CONVERSION_BASED_UNIT).
"""

import re
from collections.abc import Iterator
from pathlib import Path

from beadwave.geometry.errors import InvalidGeometry

PREFIXES = {"MILLI": "mm", "CENTI": "cm", "DECI": "dm", "MICRO": "um", "KILO": "km", "$": "m"}
CONVERTED = re.compile(r"CONVERSION_BASED_UNIT\s*\(\s*'([^']*)'\s*,[^)]*\)\s*LENGTH_UNIT", re.I)
SI = re.compile(r"SI_UNIT\s*\(\s*\.?(\$|\w+)\.?\s*,\s*\.METRE\.\s*\)", re.I)

WRITTEN = re.compile(r"'Open CASCADE STEP translator [\d.]+ \d+(?:\.(\d+))?'")

NAMED_FACE = re.compile(r"ADVANCED_FACE\s*\(\s*'(?!NONE')[^']")
ENTITY = re.compile(r"#(\d+)\s*=\s*(\w+)\s*\(([^;]*)\)\s*;")
STRING = re.compile(r"'((?:[^']|'')*)'|/\*.*?\*/", re.S)
PLAIN = re.compile(
    r"[\w .+()#:=<>\[\]-]{0,200}", re.A
)  # strings that OpenCASCADE keeps as they are
DIRECTIVE = re.compile(
    r"''|\\\\|\\S\\(?P<page>.)|\\P(?P<alphabet>[A-I])\\|\\X\\(?P<byte>[0-9A-Fa-f]{2})"
    r"|\\X2\\(?P<two>(?:[0-9A-Fa-f]{4})*)\\X0\\|\\X4\\(?P<four>(?:[0-9A-Fa-f]{8})*)\\X0\\|[\r\n]",
    re.S,
)
# a file that a document consists of, and the endings of those that hold parts
DOCUMENT = re.compile(r"DOCUMENT_FILE\s*\(\s*'((?:[^']|'')*)'")
ENDINGS = (".stp", ".step", ".p21", ".stpx", ".stpz")
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


def other_files(path: Path) -> list[str]:
    """Names of the STEP files that the file refers to for parts of its assembly."""
    names = [decoded(match[1]) for match in DOCUMENT.finditer(text_of(path))]
    return [
        name
        for name in dict.fromkeys(names)
        if name.lower().endswith(ENDINGS) and name.lower() != path.name.lower()
    ]


def text_of(path: Path) -> str:
    """The file as text: UTF-8, or what Western systems wrote before."""
    content = path.read_bytes()
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return content.decode("cp1252", errors="replace")


def decoded(string: str) -> str:
    """A string of a STEP file as a person reads it, without line breaks: doubled apostrophes and
    control directives resolved (X, X2, X4, and S with the alphabet of P)."""
    alphabet = "A"

    def letter(match: re.Match) -> str:
        nonlocal alphabet
        if match["page"]:
            code = bytes([(ord(match["page"]) + 128) % 256])
            return code.decode(f"iso8859-{ord(alphabet) - 64}", errors="replace")
        if match["alphabet"]:
            alphabet = match["alphabet"]
            return ""
        for group, encoding in (("byte", "latin-1"), ("two", "utf-16-be"), ("four", "utf-32-be")):
            if match[group] is not None:
                return bytes.fromhex(match[group]).decode(encoding, errors="replace")
        return {"''": "'", "\\\\": "\\"}.get(match[0], "")

    return DIRECTIVE.sub(letter, string)


def encoded(name: str) -> str:
    """A name as a string of a STEP file has it, in ASCII, without the apostrophes around it."""
    escaped = name.replace("\\", "\\\\").replace("'", "''")
    return re.sub(
        r"[^\x20-\x7e]+",
        lambda match: (
            f"\\X2\\{match[0].encode('utf-16-be').hex().upper()}\\X0\\"
            if max(match[0]) <= "\uffff"
            else f"\\X4\\{match[0].encode('utf-32-be').hex().upper()}\\X0\\"
        ),
        escaped,
    )


def plainly_named(path: Path, copy: Path) -> dict[str, str]:
    """Write the file to `copy` with words of ASCII in place of the strings that OpenCASCADE would
    change (it takes bytes as UTF-8, and / for the end of a name); return the strings, decoded, by
    these words. Without any such string nothing is written."""
    text, strings = text_of(path), {}

    def replaced(match: re.Match) -> str:
        if match[1] is None or PLAIN.fullmatch(match[1]):
            return match[0]
        word = f"string-{len(strings) + 1}-of-the-file"
        strings[word] = decoded(match[1])
        return f"'{word}'"

    head, data, body = text.partition("DATA;")
    plain = STRING.sub(replaced, body)
    if strings:
        copy.write_text(head + data + plain, encoding="utf-8", newline="\n")
    return strings


def face_names(path: Path) -> list[list[str]]:
    """Names of the faces of every solid in the file, "" for a face without, or with its own number
    in the file for a name; an empty list where no face has a name."""
    text = text_of(path)
    if not NAMED_FACE.search(text):
        return []
    # strings stand aside, so that what is in them is no entity
    strings: list[str] = []

    def aside(match: re.Match) -> str:
        if match[1] is None:
            return ""
        strings.append(match[1])
        return f"'{len(strings) - 1}'"

    bare = STRING.sub(aside, text)
    entities = {number: (kind, inside) for number, kind, inside in ENTITY.findall(bare)}
    names = []
    for kind, inside in entities.values():
        if kind in SOLIDS:
            of_solid = []
            for number, content in _faces(inside, entities):
                name = decoded(strings[int(content.split("'")[1])])
                unnamed = name in ("NONE", number, f"#{number}")
                of_solid.append("" if unnamed else name)
            names.append(of_solid)
    return names


def _faces(inside: str, entities: dict[str, tuple[str, str]]) -> Iterator[tuple[str, str]]:
    """Numbers and contents of the faces of a solid, a shell or an oriented shell, in the order of
    the file."""
    for number in REFERENCE.findall(inside):
        kind, content = entities.get(number, ("", ""))
        if kind == "ADVANCED_FACE":
            yield number, content
        elif kind.endswith("CLOSED_SHELL"):
            yield from _faces(content, entities)


def name_solids(path: Path, names: list[str]) -> None:
    """Writes names, in their order, in place of the numbered ones that OpenCASCADE gives solids."""
    text = path.read_text(encoding="latin-1")

    def named(match: re.Match) -> str:
        if match[1] is None and len(names) > 1:
            return "'assembly'"
        return f"'{encoded(names[int(match[1] or 1) - 1])}'"

    path.write_text(WRITTEN.sub(named, text), encoding="latin-1", newline="\n")
