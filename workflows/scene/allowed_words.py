"""The words that a key of a scene may be, for the sentence that asks for it."""

from collections.abc import Iterator, Sequence
from types import UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin


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


def _kinds(annotation: Any) -> Iterator[Any]:
    """The types in an annotation, one by one."""
    if get_origin(annotation) is Annotated:
        yield from _kinds(get_args(annotation)[0])
    elif get_origin(annotation) in (Union, UnionType):
        for member in get_args(annotation):
            yield from _kinds(member)
    else:
        yield annotation
