"""Materials that a scene may name, `material = "steel"`, in place of their numbers.

Numbers next to the name replace its own. Each is of one common grade; a structure's own grade,
temper and batch differ by some per cent in stiffness and by much more in yield stress.
"""

from collections.abc import Iterable
from re import sub
from typing import Any, NamedTuple

from pydantic import model_validator


class NamedMaterial(NamedTuple):
    """Numbers of a grade at room temperature, and where they stand."""

    young: float  # [Pa]
    poisson: float
    density: float  # [kg/m^3]
    yield_stress: float  # [Pa] in uniaxial loading
    source: str


NAMED = {
    "steel": NamedMaterial(
        210e9, 0.3, 7850.0, 355e6,
        "structural steel S355: EN 1993-1-1, 3.2.6 and table 3.1; density EN 1991-1-1",
    ),
    "bearing-steel": NamedMaterial(
        203e9, 0.3, 7830.0, 2030e6,
        "balls of AISI 52100 (100Cr6), hardened to 60 HRC and more: makers' data sheets, "
        "29.5e6 psi, 0.283 lb/in^3, 295 000 psi",
    ),
    "aluminium-6082": NamedMaterial(
        70e9, 0.3, 2700.0, 260e6,
        "EN AW-6082 T6, profiles of 5 to 25 mm: EN 755-2; elasticity EN 1999-1-1, 3.2.5",
    ),
    "aluminium-6061": NamedMaterial(
        68.9e9, 0.33, 2700.0, 276e6,
        "6061 T6: ASM Aerospace Specification Metals, MA6061T6",
    ),
    "aluminium-7075": NamedMaterial(
        71.7e9, 0.33, 2810.0, 503e6,
        "7075 T6: ASM Aerospace Specification Metals, MA7075T6",
    ),
    "stainless-304": NamedMaterial(
        200e9, 0.3, 7900.0, 190e6,
        "AISI 304 (1.4301), bars: EN 10088-3; elasticity EN 1993-1-4, 2.1.3",
    ),
    "titanium": NamedMaterial(
        114e9, 0.33, 4430.0, 830e6,
        "Ti-6Al-4V (grade 5), annealed bar: ASM Aerospace Specification Metals, MTP644",
    ),
    "brass": NamedMaterial(
        97e9, 0.31, 8490.0, 124e6,
        "free-cutting brass UNS C36000, annealed: Copper Development Association; half-hard rods "
        "yield at 310e6 Pa",
    ),
    "glass": NamedMaterial(
        70e9, 0.2, 2500.0, 2000e6,
        "soda-lime float glass: EN 572-1; it cracks before it yields, the yield stress is a third "
        "of its Knoop hardness of 6 GPa",
    ),
    "pmma": NamedMaterial(
        3.3e9, 0.37, 1190.0, 110e6,
        "cast acrylic sheet: Roehm, PLEXIGLAS GS 233, technical information 211-1, ISO 527 and 604",
    ),
    "ptfe": NamedMaterial(
        1.46e9, 0.46, 2178.0, 15e6,
        "balls of PTFE: C. Daraio et al., Phys. Rev. E 72 (2005) 016603; strength of sheets ISO "
        "13000, it creeps",
    ),
}  # fmt: skip
NUMBERS = ("young", "poisson", "density", "yield_stress")
# other names of the same material
SYNONYMS = {
    "acrylic": "pmma", "acrylic-glass": "pmma", "perspex": "pmma", "plexiglas": "pmma",
    "plexiglass": "pmma", "s355": "steel", "structural-steel": "steel", "100cr6": "bearing-steel",
    "52100": "bearing-steel", "ti-6al-4v": "titanium", "titanium-grade-5": "titanium",
    "teflon": "ptfe", "float-glass": "glass", "soda-lime-glass": "glass",
}  # fmt: skip
# words of a name that are spelled otherwise
SPELLINGS = (
    (r"[\s_]+", "-"), ("aluminum", "aluminium"), (r"^(en-aw|alu?)(-|$)", r"aluminium\2"),
    ("^stainless-steel", "stainless"), ("^(aisi|inox)-", "stainless-"), ("-t6$", ""),
)  # fmt: skip
# names of many materials besides those that begin a name of theirs, as `aluminium` does
FAMILIES = {"polymer": ("pmma", "ptfe"), "plastic": ("pmma", "ptfe"), "inox": ("stainless-304",)}


def named_material(name: str) -> NamedMaterial | None:
    """The material of a name: in capitals or not, with spaces or hyphens, in American spelling, or
    a synonym; None for one that is not known."""
    word = _spelled(name)
    return NAMED.get(SYNONYMS.get(word, word)) or NAMED.get(f"aluminium-{word}")


def family(name: str) -> list[str]:
    """The known materials of the family that a name stands for; none where it stands for none."""
    word = _spelled(name)
    return [*FAMILIES.get(word, ()), *(known for known in NAMED if known.startswith(f"{word}-"))]


def _spelled(name: str) -> str:
    word = name.strip().lower()
    for pattern, replacement in SPELLINGS:
        word = sub(pattern, replacement, word)
    return word


def numbers_of(name: str) -> NamedMaterial:
    """The material of a name; raises ValueError for one that is not known."""
    material, members = named_material(name), family(name)
    if material is None:
        why = "names a family" if members else "is not known"
        raise ValueError(
            f"material = {name!r} {why}, there are {', '.join(members or NAMED)}; take one of "
            "them, or give young, poisson and density"
        )
    return material


def with_numbers(table: Any, numbers: Iterable[str] = NUMBERS) -> Any:
    """A table with the numbers of the `material` that it names, where it gives none itself; of a
    list of names a list of numbers."""
    name = table.get("material") if isinstance(table, dict) else None
    if isinstance(name, list | tuple) and name and all(isinstance(n, str) for n in name):
        materials = [numbers_of(n) for n in name]
        of_name = {key: [getattr(material, key) for material in materials] for key in numbers}
    elif isinstance(name, str):
        of_name = {key: getattr(numbers_of(name), key) for key in numbers}
    else:
        return table
    return of_name | {key: value for key, value in table.items() if value is not None}


def of_named_material(*numbers: str):
    """The validator of a table with a `material`, which fills in these numbers, or all."""
    return model_validator(mode="before")(
        lambda cls, table: with_numbers(table, numbers or NUMBERS)
    )
