"""The keys of a scene, an entry each: meaning, values, unit, usual range, default.

What a key is stands in the comment behind its field, or in the lines above it; the unit comes from
its type. A name of the user's is written NAME, a row of a list without names N.
"""

import ast
import inspect
import re
from collections import Counter
from collections.abc import Iterator
from functools import cache
from math import inf, isinf, sqrt
from textwrap import dedent
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, NamedTuple, Union, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

from beadwave.workflows.scene.quantities import Quantity, quantity_of
from beadwave.workflows.scene.rig import RigTable
from beadwave.workflows.scene.scene import Scene
from beadwave.workflows.scene.scene_table import InvalidScene, nearest
from beadwave.workflows.scene.tables.bodies import General, Meshing
from beadwave.workflows.scene.tables.mesh import Mesh
from beadwave.workflows.scene.toml import INSTEAD

# what the tables are whose kind the scene decides
KIND = "which of the tables below it is"
# a value of each key whose default, or whose last word of several, would show nothing; by the key,
# or by its last word in all tables
EXAMPLES: dict[str, Any] = {
    "contact.stiffness": 3e12,
    "contact.file": "force.csv",
    "chains.NAME.name": "left", "chains.NAME.on": "plate:+z", "chains.NAME.at": ["-50 mm", 0.0],
    "chains.NAME.patch_radius": "2 mm", "chains.NAME.count": 12, "chains.NAME.radius": "6 mm",
    "chains.NAME.material": "bearing-steel", "chains.NAME.initial_velocity": [0.3, 0.0, 0.0],
    "chains.NAME.striker.velocity": 0.3, "chains.NAME.striker.time": "50 us",
    "chains.NAME.contact.law": "hertz", "chains.NAME.contact.stiffness": 3e12,
    "chains.NAME.contact.file": "force.csv", "chains.NAME.contact.yield_pressure": "1.6 GPa",
    "chains.NAME.contact.coefficient": 0.1, "chains.NAME.contact.stiffness_factor": 1.2,
    "chains.NAME.leaf_springs.stiffness": "1 kN/m", "chains.NAME.leaf_springs.offset": "1 um",
    "chains.NAME.preload.force": "20 N", "chains.NAME.preload.mass": 0.1,
    "chains.NAME.friction.coefficient": 0.2, "chains.NAME.friction.between_spheres": 0.1,
    "chains.NAME.friction.upstream": "free", "chains.NAME.arm.stiffness": ["2 MN/m", "inf"],
    "chains.NAME.arm.rotation": "inf", "chains.NAME.arm.inertia": "1e-6 kg m^2",
    "chains.NAME.output.spheres": [4],
    "crystal.lattice": "hexagonal", "crystal.size": [21, 26], "crystal.half_angle": 45.0,
    "crystal.nodes": "nodes.csv", "crystal.links": "links.csv", "crystal.radius": "6 mm",
    "crystal.sides": "periodic", "crystal.missing": [[10, 3]], "crystal.scatter": 1e-3,
    "crystal.drive.file": "shake.csv", "crystal.drive.at": [10, 0], "crystal.drive.row": 0,
    "crystal.drive.plane": 0, "crystal.drive.quantity": "displacement",
    "crystal.drive.direction": [0.0, 1.0, 0.0],
    "crystal.seed": 7, "crystal.precompression": "1 um", "crystal.force": "10 N",
    "crystal.inclusions.N.at": [10, 12], "crystal.inclusions.N.radius": "5 mm",
    "crystal.striker.at": [10, 0], "crystal.striker.row": 0, "crystal.striker.plane": 0,
    "crystal.striker.velocity": 0.3, "crystal.striker.direction": [0.0, 1.0, 0.0],
    "name": "lid", "scene.name": "my-rig", "unusual": ["chain.radius"],
    "chain.count": 17, "chain.radius": "12.7 mm", "chain.initial_velocity": [0.3, 0.0, 0.0],
    "material": "steel", "young": "210 GPa", "poisson": 0.3, "density": 7850.0,
    "yield_stress": "355 MPa", "chain.material": "bearing-steel",
    "striker.tangential_velocity": [0.1, 0.0], "friction.coefficient": 0.2,
    "friction.between_spheres": 0.1,
    "arm.stiffness": "2 MN/m", "arm.rotation": 1e4, "arm.inertia": 1e-4,
    "shakers.NAME.name": "shaker", "shakers.NAME.on": "wall", "shakers.NAME.at": [0.0, 0.0],
    "shakers.NAME.direction": "y", "shakers.NAME.frequency": 100.0,
    "shakers.NAME.displacement": "20 um", "shakers.NAME.velocity": "10 mm/s",
    "shakers.NAME.acceleration": 8.0, "shakers.NAME.force": "20 N",
    "shakers.NAME.radius": "5 mm", "shakers.NAME.stinger": "1 MN/m", "shakers.NAME.phase": 90.0,
    "striker.velocity": 0.31, "striker.drop": "5 mm",
    "contact.law": "hertz", "contact.yield_pressure": "1.6 GPa", "contact.coefficient": 0.1,
    "contact.stiffness_factor": 1.2, "leaf_springs.stiffness": "1 kN/m",
    "leaf_springs.offset": "1 um", "guides.coefficient": 0.1, "guides.force": "0.5 N",
    "preload.force": "20 N", "preload.mass": 0.1,
    "wall.frequency": "269 Hz", "wall.mass": 2.0, "wall.damping_ratio": 0.01,
    "wall.coefficient": 300.0, "wall.plate_thickness": "5 mm", "wall.file": "rom.npz",
    "wall.receptance": "frf.uff", "wall.response": 1, "wall.sensor_distance": "12 mm",
    "wall.nodes": [101, 102, 103], "wall.weights": [0.25, 0.5, 0.25], "wall.half_space": 1e-9,
    "cutoff": "20 kHz", "wall.curvatures": [20.0, 0.0],
    "length": "200 mm", "width": "30 mm", "thickness": "10 mm", "diameter": "12 mm",
    "bore": "4 mm", "beam.area": 3e-4, "beam.second_moment": 2.5e-9, "shear_factor": 0.83,
    "shift": "1 MN/m", "turn": 1e4, "position": "80 mm", "axial_force": "-2 kN",
    "left": "hinged", "right": "hinged", "front": "free", "back": "free",
    "plate.at": ["60 mm", "40 mm"], "in_plane_x": "10 kN/m", "in_plane_y": "10 kN/m",
    "step": "gearbox.step", "assembly.mesh": "frame.msh", "merge": "1 um",
    "volumes": ["frame", "lid"], "assembly.held": ["base:-z"],
    "on": "beam:-x", "directions": "z", "touching": "tied", "mesh.file": "rig.msh",
    "expansion": 12e-6, "shear": ["4 GPa", "4 GPa", "3 GPa"],
    "axes": [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
    "box": ["120 mm", "40 mm", "8 mm"], "bodies.NAME.at": [0.0, 0.0, "20 mm"],
    "bodies.NAME.turn": [0.0, 90.0, 0.0], "radius": "10 mm",
    "measured.NAME.receptance": "table.uff", "measured.NAME.points": [1, 2, 3, 4],
    "measured.NAME.at": [[0.04, 0.0], [-0.04, 0.0]], "measured.NAME.highest": "800 Hz",
    "measured.NAME.held": True,
    "measured.NAME.lowest": "20 Hz",
    "outline": [[0.0, 0.0], [0.1, 0.0], [0.1, 0.05], [0.0, 0.05]],
    "bodies.NAME.holes.at": [["20 mm", "20 mm"], ["80 mm", "20 mm"]],
    "around": [[0.0, 0.0], [90.0, "20 mm"]], "depth": "8 mm",
    "seed": "4 mm", "output.instrument.seed": 7, "between": "lid|base",
    **dict.fromkeys(("kx", "ky", "kz"), "50 MN/m"), **dict.fromkeys(("krx", "kry", "krz"), 1e4),
    **dict.fromkeys(("cx", "cy", "cz"), 100.0), **dict.fromkeys(("crx", "cry", "crz"), 0.1),
    "joints.NAME.at": "holes", "washer": "9 mm", "sides": ["rigid", "mean"],
    "stack": ["plate", "left", "right"], "joints.NAME.bolt": "M8-8.8",
    "joints.NAME.preload": "12 kN", "joints.NAME.torque": "20 N m", "torque_deviation": 0.15,
    "joints.NAME.friction": 0.15, "Ra": "1.6 um", "rms": "2 um", "joints.NAME.model": "contact",
    "flatness": "20 um",
    "joints.NAME.bolt.diameter": "8 mm", "joints.NAME.bolt.pitch": "1.25 mm",
    "proof_stress": "580 MPa", "bearing": "12 mm", "across_flats": "13 mm",
    "head_height": "5.3 mm", "nut_height": "6.8 mm",
    "assembly.parts": ["block", "sheets", "sheets_support"],
    "strike.on": "lid:+z", "strike.at": [0.0, "20 mm"], "strike.radius": "2 mm",
    "strike.nodes": [[0.0, 0.02], [0.0, 0.021]], "title": "pitch",
    "assembly.held.N.under.at": [[0.09, 0.09, 0.0]], "ties.N.under.at": [[0.015, 0.0, 0.011]],
    "assembly.held.N.under.sides": [0.02, 0.02], "ties.N.under.sides": [0.02, 0.02],
    "loads.NAME.on": "lid:+z", "loads.NAME.force": "500 N", "direction": [0.0, 0.0, -1.0],
    "wall.direction": 1, "body": "lid", "temperature": 40.0, "to": "base:-z",
    "tension": "5 kN", "loads.NAME.stiffness": "20 MN/m",
    "masses.NAME.name": "sensor", "masses.NAME.on": "lid:+z", "masses.NAME.at": ["20 mm", 0.0],
    "masses.NAME.mass": "12 g", "masses.NAME.radius": "7 mm", "height": "6 mm",
    "masses.NAME.inertia": ["400 g mm^2", "400 g mm^2", "300 g mm^2"],
    "springs.NAME.name": "cord", "springs.NAME.on": "lid:+z",
    "springs.NAME.at": [["90 mm", "60 mm"], ["-90 mm", "60 mm"]], "springs.NAME.radius": "5 mm",
    "springs.NAME.to": "ground", "to_at": [[0.0, 0.0], ["10 mm", 0.0]],
    **{f"springs.NAME.{key}": "2 kN/m" for key in ("kx", "ky", "kz", "k")},
    **{f"springs.NAME.{key}": 0.5 for key in ("cx", "cy", "cz", "c")},
    "springs.NAME.direction": "normal",
    "test_axes.points": [[0.0, 0.0, 0.0], ["300 mm", 0.0, 0.0], [0.0, "200 mm", 0.0]],
    "test_axes.at": [[0.15, 0.1, 0.0], [-0.15, 0.1, 0.0], [0.15, -0.1, 0.0]],
    "hz": 269.0, "motion": "x+ry", "number": 2, "shape": "shapes.uff",
    "table.frequency": 30.0, "table.mass": 50.0, "patch.nodes": [[0.03, 0.0], [0.03, 0.002]],
    "patch.radius": "2 mm",
    "reduction.modes": 40, "reduction.error": 1e-3, "to_hz": "20 kHz", "damping.ratio": 0.01,
    "damping.materials": {"steel": 0.001}, "damping.joints": {"bolts": 0.02},
    "damping.springs": {"cord": 0.1}, "hz_deviation": 0.05, "zeta": 0.004, "zeta_deviation": 1e-4,
    "damping.alpha": 5.0, "damping.beta": 1e-7, "damping.frequency": ["50 Hz", "8 kHz"],
    "time.dt": "0.5 us", "time.error": 1e-5,
    "mesh.error": 0.02, "mesh.simplify": "2 mm", "mesh.sizes": "sizes.npz",
    "output.spheres": [1, 4, 14],
    "output.sensors.N.on": "block:+y", "output.sensors.N.at": ["10 mm", 0.0],
    "output.sensors.N.direction": "y", "output.sensors.N.radius": "5 mm",
    "output.sensors.N.chain": "above",
    "sphere": 4, "gain": "4 mV/N", "low_pass": "100 kHz", "high_pass": "1 kHz", "range": 5.0,
    "noise": 0.01, "bits": 12,
}  # fmt: skip
EITHER = {"assembly": (General, RigTable), "mesh": (Meshing, Mesh)}


class KeyEntry(NamedTuple):
    """A dotted key of a scene."""

    key: str
    values: str  # in words: number, text, one of "a", "b"; a list of these
    unit: str  # SI; empty without one
    usual: str  # range of its size; empty where any is
    default: str  # as TOML; "required", or empty where it may be absent
    replaces: tuple[str, ...]  # keys of the same table that go when it is set
    meaning: str
    of: str  # the kind of its table, where a table has several: kind = "1dof"
    example: str  # as TOML; for NAME and N a name and 1

    def text(self) -> str:
        """The entry in lines."""
        unit = f" [{self.unit}]" if self.unit else ""
        lines = [f"{self.key}{unit}  {self.meaning}", f"  values    {self.values}"]
        if self.usual:
            lines.append(f"  usual     {self.usual}")
        lines.append(f"  default   {self.default or 'none: may be absent'}")
        if self.replaces:
            lines.append(f"  replaces  {', '.join(self.replaces)}")
        if self.of:
            lines.append(f"  of        {self.of}")
        lines.append(f"  example   {self.example}")
        return "\n".join(lines)


@cache
def scene_keys() -> tuple[KeyEntry, ...]:
    """Every key of every table, in the order of the tables; a key of several kinds of its table
    once for each, and one entry where the kinds of an `EITHER` table say the same."""
    entries = [*_keys_of(Scene, ())]
    of_kinds = Counter(entry._replace(of="") for entry in entries)
    n_kinds = {table: len(kinds) for table, kinds in EITHER.items()}
    return tuple(
        dict.fromkeys(
            shared if of_kinds[shared] == n_kinds.get(entry.key.partition(".")[0]) else entry
            for entry in entries
            for shared in [entry._replace(of="")]
        )
    )


def entries_of(key: str) -> tuple[KeyEntry, ...]:
    """The entries of a key, its names left out, as NAME or as the user's own, or of all keys of a
    table; of a word alone of all keys that have it as one of their words, then of those that
    contain it, sorted, and unless it is one of their words of those whose meaning has it, or each
    of several words. Raises InvalidScene for what no key contains."""
    # dotted words: the keys whose path begins with them, NAME and N left out
    words = key.split(".")
    paths = {entry: entry.key.split(".") for entry in scene_keys()}
    entries = tuple(
        entry
        for entry, path in paths.items()
        if len(words) > 1 and [p for p in path if p not in ("NAME", "N")][: len(words)] == words
    )
    if len(words) > 1 and not entries and (bare := [w for w in words if not w.isdigit()]) != words:
        # a row of a list that may be one table, holes.2.diameter
        entries = tuple(
            entry
            for entry, path in paths.items()
            if len(path) >= len(bare)
            and all(w == p or p == "NAME" for w, p in zip(bare, path, strict=False))
        )

    # with names of the user's own in place of NAME and N
    entries = entries or tuple(
        entry
        for entry, path in paths.items()
        if len(path) >= len(words)
        and all(w == p or p in ("NAME", "N") for w, p in zip(words, path, strict=False))
    )

    # one word: no table of this name, so the keys that contain it, and those that are about it
    if not entries and key and len(words) == 1:
        containing = [entry for entry in paths if key in entry.key]
        entries = tuple(sorted(containing, key=lambda e: (key not in paths[e], e.key)))
        # a word that is no key, as bolt: keys that are about it too; of several words about all
        if not any(key in path for path in paths.values()):
            stems = [re.escape(w.rstrip("s")) for w in re.findall(r"\w{3,}", key)]
            about = [re.compile(rf"\b{stem}(s|ed|ing)?\b", re.IGNORECASE) for stem in stems]
            entries += tuple(
                e for e in paths
                if about and e not in entries and all(a.search(e.meaning) or
                any(a.fullmatch(p) for p in paths[e]) for a in about)
            )  # fmt: skip
    elif len(words) == 1:  # a table, and the keys of this name in other tables
        entries += tuple(e for e in paths if key in paths[e] and e not in entries)
    if not entries:
        close = nearest(key, {entry.key for entry in scene_keys()})
        if close.startswith("known"):  # hundreds: the tables are enough
            tables = dict.fromkeys(entry.key.split(".")[0] for entry in scene_keys())
            close = f"`beadwave scene --key TABLE` lists those of {', '.join(tables)}"
        raise InvalidScene(f"{key!r} is no key of a scene, {close}.")
    return entries


def _keys_of(table: type[BaseModel], path: tuple[str, ...], of: str = "") -> Iterator[KeyEntry]:
    """The entries of a table at a path, tables below it in its place."""
    meanings = _meanings(table)
    for name, field in table.model_fields.items():
        key = (*path, name)
        annotation = (
            Annotated[field.annotation, *field.metadata] if field.metadata else (field.annotation)
        )
        tables = EITHER.get(name, ()) if table is Scene else ()
        below = [(t, ()) for t in tables] or [*_tables(annotation)]
        # one table or a list of them: the keys of the one
        alone = [t for t, step in below if not step]
        below = [(t, step) for t, step in below if not (step and t in alone)]

        # tables of several kinds: their kind is one key, and each of their keys says of which
        kinds = {t: _kind(t) for t, _ in below if len(below) > 1}
        named = [kind for kind in kinds.values() if kind]
        if named:
            text = f"one of {', '.join(map(_toml, named))}"
            default = _toml(below[-1][0].model_fields["kind"].default)
            kind_key, first = ".".join((*key, "kind")), f"kind = {_toml(named[0])}"
            yield KeyEntry(kind_key, text, "", "", default, (), KIND, "", first)
        for t, step in below:
            of_kind = of
            if kind := kinds.get(t):
                of_kind = f'kind = "{kind}"'
            elif len(below) > 1:
                of_kind = re.split("[.:;]", t.__doc__ or "")[0]
            entries = _keys_of(t, (*key, *step), of_kind)
            yield from (e for e in entries if not (kind and e.key.endswith(".kind")))

        values = _values(annotation)
        if not values:
            continue
        quantity = quantity_of(table, name)
        yield KeyEntry(
            ".".join(key),
            values,
            quantity.kind.unit if quantity else "",
            _usual(quantity),
            _toml(field.default),
            tuple(sorted(INSTEAD.get(".".join(key), set()) & table.model_fields.keys())),
            meanings.get(name) or field.description or "",
            of,
            f"{name} = {_toml(_example('.'.join(key), annotation, field, quantity))}",
        )


def _kind(table: type[BaseModel]) -> str | None:
    """The kind of a table that is one of several; None where it has no such key."""
    field = table.model_fields.get("kind")
    words = get_args(field.annotation) if field else ()
    return words[0] if len(words) == 1 else None


def _tables(annotation: Any) -> Iterator[tuple[type[BaseModel], tuple[str, ...]]]:
    """The tables in an annotation, and the step to them: NAME in a table by name and in a list of
    tables with a name, N in a list without."""
    origin, arguments = get_origin(annotation), get_args(annotation)
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation, ()
    elif origin is dict:
        for table, _ in _tables(arguments[1]):
            yield table, ("NAME",)
    elif origin is tuple:
        for table, _ in _tables(arguments[0]):
            yield table, ("NAME" if "name" in table.model_fields else "N",)
    elif origin is Annotated:
        yield from _tables(arguments[0])
    elif origin in (Union, UnionType):
        for argument in arguments:
            yield from _tables(argument)


def _values(annotation: Any) -> str:
    """Values that an annotation takes, in words; empty for tables alone.

    By the kind of the annotation: bounds of a number, literals, alternatives, lists, tables by
    name; each asks for the words of what is in it.
    """
    origin, arguments = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        words = _values(arguments[0])
        bounds = [
            f"{sign} {getattr(limit, attribute):g}"
            for limit in _constraints(annotation)
            for attribute, sign in (("ge", "≥"), ("gt", ">"), ("le", "≤"), ("lt", "<"))
            if getattr(limit, attribute, None) is not None
        ]
        return (
            f"{words} {', '.join(bounds)}"
            if words in ("number", "whole number") and bounds
            else words
        )
    if origin is Literal:
        words = ", ".join(f'"{a}"' for a in arguments)
        return words if len(arguments) == 1 else f"one of {words}"
    if origin in (Union, UnionType):
        alternatives = [_values(a) for a in arguments if a is not NoneType]
        return " or ".join(dict.fromkeys(words for words in alternatives if words))
    if origin is tuple:
        if arguments[-1] is Ellipsis:
            words = _values(arguments[0])
            return f"list of {words}" if words else ""
        alternatives = list(dict.fromkeys(_values(a) for a in arguments))
        return f"list of {len(arguments)}: {', '.join(alternatives)}" if all(alternatives) else ""
    if origin is dict:
        words = _values(arguments[1])
        return f"table by name of {words}" if words else ""
    return {float: "number", int: "whole number", bool: "true or false", str: "text"}.get(
        annotation, ""
    )


def _constraints(annotation: Any) -> Iterator[Any]:
    """Limits of a number, those in the metadata of its Field too."""
    for metadata in getattr(annotation, "__metadata__", ()):
        yield metadata
        yield from getattr(metadata, "metadata", ())


def _usual(quantity: Quantity | None) -> str:
    """The usual range of a quantity's size; empty where any is."""
    if quantity is None or (quantity.low == 0 and isinf(quantity.high)):
        return ""
    unit = quantity.kind.unit
    if quantity.low == 0:
        return f"up to {quantity.high:g} {unit}"
    return f"{quantity.low:g} to {quantity.high:g} {unit}"


def _example(key: str, annotation: Any, field: FieldInfo, quantity: Quantity | None) -> Any:
    """A value that the key may have: of its field, of EXAMPLES, its last word, its default, or
    where a number has none one from its usual range."""
    if field.examples:
        return field.examples[0]
    full = key if "." in key else f"scene.{key}"
    for name in (full, key.rpartition(".")[2]):
        if name in EXAMPLES:
            value = EXAMPLES[name]
            pair = _values(annotation).startswith("list of 2: number")
            return (value, value) if pair and not isinstance(value, list) else value
    if words := re.findall(r'"([^"]*)"', _values(annotation)):
        return words[-1]
    if field.default is PydanticUndefined and _values(annotation).startswith("number"):
        # the middle of its usual range, to one digit
        limited = quantity and quantity.low > 0 and not isinf(quantity.high)
        return float(f"{sqrt(quantity.low * quantity.high):.0e}") if limited else 1.0
    return field.default


def _toml(default: Any) -> str:
    """A default as TOML."""
    if default is PydanticUndefined:
        return "required"
    if default is None or isinstance(default, BaseModel):
        return ""
    if isinstance(default, tuple | list):
        return f"[{', '.join(map(_toml, default))}]"
    if isinstance(default, dict):
        pairs = ", ".join(f"{key} = {_toml(value)}" for key, value in default.items())
        return f"{{ {pairs} }}" if pairs else "{}"
    if isinstance(default, str):
        return f'"{default}"'
    if isinstance(default, bool):
        return str(default).lower()
    return (
        "inf" if default == inf else f"{default:g}" if isinstance(default, float) else f"{default}"
    )


def _meanings(table: type[BaseModel]) -> dict[str, str]:
    """Meaning of each field of a table: the comment behind it, or the comment lines above it,
    without its unit."""
    meanings: dict[str, str] = {}
    for base in reversed(table.__mro__):
        if not (isinstance(base, type) and issubclass(base, BaseModel)) or base is BaseModel:
            continue
        try:
            source = dedent(inspect.getsource(base))
        except OSError:  # a table that is made of another's fields
            continue
        lines = source.splitlines()
        for node in ast.parse(source).body[0].body:
            if not (isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name)):
                continue
            behind = lines[node.end_lineno - 1][node.end_col_offset :].partition("#")[2].strip()
            above, line = [], node.lineno - 2
            while lines[line].strip().startswith("#"):
                above.insert(0, lines[line].strip("# "))
                line -= 1
            behind = re.sub(r"^type: ignore\S*", "", behind).strip()
            words = behind or " ".join(above)
            # its unit, or its units, come from its type
            meanings[node.target.id] = re.sub(r"^\[[^]]*\] ", "", words)
    return meanings
