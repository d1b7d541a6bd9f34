"""A scene's text with other values, its comments and its order kept."""

from collections.abc import Mapping, MutableMapping
from typing import Any

import tomlkit


def with_values(text: str, before: Mapping[str, Any], after: Mapping[str, Any]) -> str:
    """The TOML with those values, of the tables of a scene, in which `after` differs from `before`.

    Keys that only `before` has are left out, keys that only `after` has are added.
    """
    document = tomlkit.parse(text)
    _change(document, before, after)
    return tomlkit.dumps(document)


def _change(
    table: MutableMapping[str, Any], before: Mapping[str, Any], after: Mapping[str, Any]
) -> None:
    """Bring a table of TOML, in place, from the values `before` to those `after`; what is equal in
    both stays as it is written, with its comments."""
    for key in before.keys() - after.keys():
        table.pop(key, None)
    for key, value in after.items():
        there, was = table.get(key), before.get(key)
        if value == was:
            continue
        if there is None and isinstance(value, Mapping) and isinstance(was, Mapping):
            # a table whose values were all defaults: those that differ alone
            table[key] = {k: v for k, v in value.items() if v != was.get(k)}
        elif isinstance(value, Mapping) and isinstance(there, MutableMapping):
            _change(there, was if isinstance(was, Mapping) else {}, value)
        elif _tables(value) and _tables(there) and len(value) == len(there):
            were = was if _tables(was) and len(was) == len(value) else [{}] * len(value)
            for one, old, new in zip(there, were, value, strict=True):
                _change(one, old, new)
        else:
            table[key] = value


def _tables(value: Any) -> bool:
    return isinstance(value, list) and bool(value) and isinstance(value[0], Mapping)
