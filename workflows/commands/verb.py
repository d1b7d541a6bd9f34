"""Commands whose arguments are those of a Python function.

`@verb("beadwave.workflows.fit.api.design", json="...")` gives a command the arguments, types and
defaults of that function, and the texts of its docstring as help:

    arguments     those in front of the `*`
    options       those behind it that have a line `name  text` in the docstring, or are in USUAL
    neither       all others: callables and objects, which only Python passes

What the command line adds (words for values, completion) is in USUAL, or in the decorator where it
is for one command. The function's module is imported when its command is called, so that
`beadwave --help` imports none; its annotations have to be texts (`from __future__`).
"""

import re
from collections.abc import Callable
from importlib import import_module
from inspect import Parameter, Signature, cleandoc, signature
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import typer

from beadwave.workflows.commands.options import Quiet, dotted_keys, json_of, scene_names
from beadwave.workflows.commands.terminal import StageProgress


class Word(NamedTuple):
    """An argument on the command line, in addition to its function; None: nothing more."""

    help: str | None = None
    name: str | None = None  # --hold-out of hold_out without one
    metavar: str | None = None
    completes: Callable | None = None  # values that a shell offers
    option: bool | None = None  # those behind the `*` are without it
    required: bool | None = None  # those without a default are without it


USUAL = {
    "scene": Word(
        "a built-in scene (beadwave scenes lists them) or a TOML file; default: rig-rom",
        metavar="SCENE", completes=scene_names,
    ),
    "over": Word(metavar="KEY=VALUES", completes=dotted_keys),
    "changes": Word(
        "set a value of the scene by its dotted key, a unit is optional: chain.radius=5mm",
        "--set", "KEY=VALUE", dotted_keys, option=True,
    ),
    "overwrite": Word("replace files beadwave did not write or that were changed since"),
}  # fmt: skip
LAST = ("changes", "overwrite")  # in the help


class Call:
    """The function with what was typed; `json` and `quiet` say what is printed of its result."""

    def __init__(self, function: Callable, given: dict[str, Any]) -> None:
        self.function = function
        self.quiet, self.json = given.pop("quiet"), given.pop("json")
        self.given = given

    def __call__(self, **more: Any) -> Any:
        """Result of the function, with progress on stderr."""
        with StageProgress(quiet=self.quiet) as progress:
            if "progress" in signature(self.function).parameters:
                more["progress"] = progress.stage
            try:
                return self.function(**self.given, **more)
            except ValueError as error:
                from beadwave.workflows.files.scene import about_its_file
                from beadwave.workflows.scene import InvalidScene

                if not isinstance(error, InvalidScene):
                    raise
                source = self.given.get("scene") or self.given.get("source")
                raise InvalidScene(about_its_file(str(error), source)) from error


class Verb:
    """A command(call, ...) that prints what a function returns; what is behind `call` are options
    of the command line alone, annotated for typer."""

    def __init__(self, command: Callable, function: str, json: str, words: dict[str, Word]) -> None:
        self.command, self.function, self.json, self.words = command, function, json, words
        self.__doc__ = command.__doc__

    def signed(self, name: str) -> Callable[..., None]:
        """The command as a function whose signature typer reads."""
        module, _, attribute = self.function.rpartition(".")
        function = getattr(import_module(module), attribute)
        texts = described(function)

        # the function's arguments that a command line can give, then the command's own
        known = texts.keys() | self.words.keys() | USUAL.keys()
        of_function = {
            one.name: _parameter(one, self.words.get(one.name, Word()), texts)
            for one in signature(function).parameters.values()
            if one.name in known
        }
        own_parameters = {
            one.name: one for one in [*signature(self.command).parameters.values()][1:]
        }
        printing = {
            "quiet": Parameter("quiet", Parameter.KEYWORD_ONLY, annotation=Quiet, default=False),
            "json": Parameter(
                "json", Parameter.KEYWORD_ONLY, annotation=json_of(self.json), default=False
            ),
        }
        last = {name: of_function.pop(name) for name in LAST if name in of_function}

        def run(**given: Any) -> None:
            """Call the command with what was typed, its own options apart."""
            of_command = {name: given.pop(name) for name in own_parameters}
            # what was not typed is the function's default
            typed = {name: value for name, value in given.items() if value is not None}
            self.command(Call(function, typed), **of_command)

        run.__doc__ = self.__doc__
        parameters = of_function | own_parameters | last | printing
        run.__signature__ = Signature(  # type: ignore[attr-defined]
            [one.replace(kind=Parameter.KEYWORD_ONLY) for one in parameters.values()]
        )
        return run


def verb(function: str, *, json: str, **words: Word) -> Callable[[Callable], Verb]:
    """Decorates the command of a function, which is given by its dotted name; `json` is the shape
    of what --json prints."""
    return lambda command: Verb(command, function, json, words)


def described(function: Callable) -> dict[str, str]:
    """Text of the docstring on each argument: lines `name text`, with indented ones below."""
    text = cleandoc(function.__doc__ or "")
    lines = re.findall(r"^(\w+) {2,}(.+(?:\n {3,}.+)*)", text, re.MULTILINE)
    return {name: " ".join(words.split()) for name, words in lines}


def _parameter(parameter: Parameter, word: Word, texts: dict[str, str]) -> Parameter:
    """The argument or option of the command line for an argument of the function."""
    usual = USUAL.get(parameter.name, Word())
    text = word.help or texts.get(parameter.name) or usual.help
    word = Word(*(b if a is None else a for a, b in zip(word, usual, strict=True)))
    text = text[0].upper() + text[1:].removesuffix(".") + "."

    option = parameter.kind is Parameter.KEYWORD_ONLY if word.option is None else word.option
    details = {"help": text, "metavar": word.metavar, "autocompletion": word.completes}
    name = word.name or "--" + parameter.name.replace("_", "-")  # no --no-... of a flag
    info = typer.Option(name, **details) if option else typer.Argument(**details)

    # what is typed for an annotation: the first type of a union; numbers, or paths, or texts
    first = parameter.annotation.partition(" | ")[0]
    path_or_text = Path if "Path" in parameter.annotation else str
    one = {"bool": bool, "int": int, "float": float}.get(first, path_or_text)
    several = first.startswith(("Changes", "Iterable", "Sequence"))
    typed, default = list[one] if several else one, parameter.default  # type: ignore[valid-type]
    if isinstance(default, float) and default.is_integer():
        default = int(default)  # the help shows 240, not 240.0
    if word.required:
        default = Parameter.empty
    elif default in (None, ()) or (default is Parameter.empty and word.required is False):
        typed, default = typed | None, None  # type: ignore[assignment]
    return parameter.replace(annotation=Annotated[typed, info], default=default)
