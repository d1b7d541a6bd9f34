"""The fields of a class that only comments describe: units, shapes and meanings for its page."""

import ast
import inspect
import tokenize
from io import StringIO
from textwrap import dedent
from typing import NamedTuple


class Field(NamedTuple):
    """A field of a NamedTuple, a dataclass or a model."""

    name: str
    type: str
    words: str  # of the comment on its line and on lines of comment below, or else above it


def fields(cls: type) -> list[Field]:
    """The annotated fields that a class states itself, in their order; none of a class whose source
    is not there."""
    try:
        source = dedent(inspect.getsource(cls))
    except (OSError, TypeError):
        return []
    # comments by their line, and those that have the line for themselves
    comments, alone = {}, set()
    for token in tokenize.generate_tokens(StringIO(source).readline):
        if token.type == tokenize.COMMENT:
            row = token.start[0]
            comments[row] = token.string.lstrip("# ")
            if token.line.lstrip().startswith("#"):
                alone.add(row)

    # beside a field, with the lines of comment below it; else the lines of comment above it
    rows = []
    body = ast.parse(source).body[0].body
    for node in body:
        if not isinstance(node, ast.AnnAssign) or node.target.id.startswith("_"):
            continue
        words = []
        if node.end_lineno in comments:
            first = row = node.end_lineno
            while row == first or row in alone:
                words.append(comments[row])
                row += 1
        else:
            row = node.lineno - 1
            while row in alone:
                words.insert(0, comments[row])
                row -= 1
        rows.append(Field(node.target.id, ast.unparse(node.annotation), " ".join(words)))
    return rows
