"""Allowed values of a key of a scene, for the sentence that asks for it: words, or a number of
values."""

from collections.abc import Iterator, Sequence
from types import UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from pydantic.fields import FieldInfo


def allowed_words(model: Any, path: Sequence[str | int]) -> str:
    """The words that the value at a path of keys below a table may be, as in "'a', 'b' or 'c'"; ""
    where it is none of a few words."""
    kinds = [model]
    for key in path:
        fields = (getattr(kind, "model_fields", {}).get(key) for kind in kinds)
        kinds = [kind for field in fields if field for kind in _kinds(field.annotation)]
    literals = (kind for kind in kinds if get_origin(kind) is Literal)
    words = [repr(word) for literal in literals for word in get_args(literal)]
    return " or ".join([", ".join(words[:-1]), *words[-1:]][len(words) < 2 :])


def wanted_values(model: Any, path: Sequence[str | int]) -> str:
    """Number of values that the list at a path of keys below a table must have, as in "3: x, y, z";
    "" if any number will do. Parts of the path that are no keys, as pydantic's names for the
    branches of a union, are passed over."""
    annotations = [model]
    for key in path:
        below = [child for annotation in annotations for child in _below(annotation, key)]
        annotations = below or annotations
    for annotation in annotations:
        for kind in _kinds(annotation):
            values = get_args(kind) if get_origin(kind) is tuple else ()
            if values and values[-1] is not Ellipsis:
                names = [m.description for m in _metadata(annotation) if m.description]
                return ": ".join([str(len(values)), *names])
    return ""


def _below(annotation: Any, key: str | int) -> Iterator[Any]:
    """The annotations of what stands under a key of a table, or at a place of a list."""
    for kind in _kinds(annotation):
        field = getattr(kind, "model_fields", {}).get(key)
        values = get_args(kind)
        if field:
            yield field.annotation
        elif get_origin(kind) is dict and isinstance(key, str):
            yield values[1]
        elif get_origin(kind) is tuple and isinstance(key, int):
            yield values[0] if values[-1] is Ellipsis else values[min(key, len(values) - 1)]


def _metadata(annotation: Any) -> Iterator[FieldInfo]:
    """The pydantic fields of an annotation, at any depth of its unions."""
    for member in (annotation, *get_args(annotation)):
        yield from (m for m in getattr(member, "__metadata__", ()) if isinstance(m, FieldInfo))


def _kinds(annotation: Any) -> Iterator[Any]:
    """The types in an annotation, one by one."""
    if get_origin(annotation) is Annotated:
        yield from _kinds(get_args(annotation)[0])
    elif get_origin(annotation) in (Union, UnionType):
        for member in get_args(annotation):
            yield from _kinds(member)
    else:
        yield annotation
