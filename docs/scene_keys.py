"""Puts every key of a scene into docs/scene-keys.md, a table for each table of a scene.

python docs/scene_keys.py
"""

from itertools import groupby
from pathlib import Path

from beadwave.workflows.scene.named_materials import NAMED, SYNONYMS
from beadwave.workflows.scene.reference import KeyEntry, scene_keys

PAGE = Path(__file__).with_name("scene-keys.md")
HEAD = """# Scene keys

Every key of a scene, by table, written from the tables themselves. `beadwave scene --key
chain.radius` prints one entry, `--key chain` those of a table. NAME is a name of yours, N the
number of a row from 1. A number with a unit may be written as text with any unit of its kind
(`"12.7 mm"`); outside its usual range it needs its unit, or its key in `unusual`.

"""
COLUMNS = "| key | |\n|---|---|\n"


def page() -> str:
    """The page's text."""
    top = [entry for entry in scene_keys() if "." not in entry.key]
    tables = groupby(
        (entry for entry in scene_keys() if "." in entry.key),
        lambda entry: entry.key.partition(".")[0],
    )
    sections = [_table("Above all tables", top)]
    sections += [_table(f"[{name}]", [*entries]) for name, entries in tables]
    return HEAD + "\n".join(sections) + _materials()


def _table(title: str, entries: list[KeyEntry]) -> str:
    """A table of a scene."""
    return f"## {title}\n\n{COLUMNS}{''.join(map(_row, entries))}"


def _row(entry: KeyEntry) -> str:
    """A key, and all that is said of it."""
    key = f"`{entry.key}`" + (f" [{entry.unit}]" if entry.unit else "")
    default = {"required": "required", "": "may be absent"}.get(
        entry.default, f"default `{entry.default}`"
    )
    words = [
        entry.meaning,
        entry.values,
        f"usually {entry.usual}" if entry.usual else "",
        default,
        f"replaces {', '.join(entry.replaces)}" if entry.replaces else "",
        f"of {entry.of}" if entry.of else "",
        f"`{entry.example}`",
    ]
    said = "; ".join(text for text in words if text)
    return f"| {key} | {said.replace('|', '&#124;')} |\n"


def _materials() -> str:
    """The materials that have a name."""
    rows = "".join(
        f"| `{name}` | {m.young / 1e9:g} | {m.poisson:g} | {m.density:g} | "
        f"{m.yield_stress / 1e6:g} | {m.source} |\n"
        for name, m in NAMED.items()
    )
    other_names = ", ".join(f"`{other}` ({name})" for other, name in SYNONYMS.items())
    return (
        '\n## Materials by name\n\n`material = "steel"` in [chain], [wall], [beam], [plate], '
        "[assembly] and [bodies.NAME] stands for these numbers; numbers beside it replace its own. "
        "Of a chain, a list names one for each sphere. Capitals, spaces in place of hyphens, "
        "`aluminum`, a T6 behind an alloy and the number of an alloy alone do not matter; "
        f"{other_names} name the same materials. A family, `aluminium` or `stainless`, is refused "
        "with the grades that are known. The yield stress serves a warning alone: a "
        "contact is judged by its softer side.\n\n"
        "| material | young [GPa] | poisson | density [kg/m^3] | yield_stress [MPa] | source |\n"
        f"|---|---|---|---|---|---|\n{rows}"
    )


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
