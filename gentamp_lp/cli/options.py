"""Options that several commands have, and options made from a settings model."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from functools import wraps
from typing import Annotated, Any, Literal

import typer
from pydantic import BaseModel
from pydantic.fields import FieldInfo

TaskArg = Annotated[str, typer.Argument(metavar="TASK", help="Path of a task file, or the name of a shipped task.")]
JsonOpt = Annotated[bool, typer.Option("--json", help="Print one JSON document to stdout.")]
QuietOpt = Annotated[bool, typer.Option("--quiet", "-q", help="No progress messages.")]
SeedOpt = Annotated[int, typer.Option("--seed", min=0, help="Same seed, same result.")]
RobotOpt = Annotated[
    str | None, typer.Option("--robot", help="Robot instead of the task's: a name or a .yaml, see docs/robots.md.")
]
TransitionsOpt = Annotated[
    Literal["plan", "around"], typer.Option("--transitions", help="Plans only, or plans and what is around them.")
]
CacheOpt = Annotated[bool, typer.Option(help="Use demonstrations planned before.")]
GrammarOpt = Annotated[
    list[str] | None,
    typer.Option("--grammar", help="Grammar file to add, or the name of a shipped one: paper (repeatable)."),
]
TrustOpt = Annotated[bool, typer.Option("--trust", help="Run the Python samplers of a domain that is not shipped.")]

_SPELLED = {"grammars": "grammar", "around": "transitions"}  # fields whose option has another name
_TYPED: dict[str, tuple[Any, Any, Callable[[Any], Any]]] = {  # and another type: annotation, default, what it means
    "grammars": (list[str] | None, None, tuple),
    "around": (Literal["plan", "around"], "around", lambda word: word == "around"),
}


def options_of(model: type[BaseModel]) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Give a command one option for each field of a settings model, in the place of its parameter `settings`.

    Name, type, default, bounds and help are those of the field. The command gets the values that were given on the
    command line (a dictionary by field), so that they can replace others.
    """

    def decorate(command: Callable[..., None]) -> Callable[..., None]:
        parameters: dict[str, inspect.Parameter] = {}
        for name, parameter in inspect.signature(command, eval_str=True).parameters.items():
            own = parameter.replace(kind=inspect.Parameter.KEYWORD_ONLY)
            parameters |= _options(model) if name == "settings" else {name: own}
        fields = {_SPELLED.get(name, name): name for name in model.model_fields}

        @wraps(command)
        def run(**values: Any) -> None:
            context = values["context"]
            given: dict[str, Any] = {}
            for option, field in fields.items():
                value, source = values.pop(option), context.get_parameter_source(option)
                if source is not None and source.name != "DEFAULT":
                    given[field] = _TYPED[field][2](value) if field in _TYPED else value
            command(settings=given, **values)

        run.__signature__ = inspect.Signature(list(parameters.values()))  # type: ignore[attr-defined]
        run.__annotations__ = {name: parameter.annotation for name, parameter in parameters.items()}
        return run

    return decorate


def _options(model: type[BaseModel]) -> dict[str, inspect.Parameter]:
    return {_SPELLED.get(name, name): _option(name, field) for name, field in model.model_fields.items()}


def _option(name: str, field: FieldInfo) -> inspect.Parameter:
    spelled = _SPELLED.get(name, name)
    annotation, default, _ = _TYPED.get(name, (field.annotation, field.default, None))
    least = next((limit.ge for limit in field.metadata if hasattr(limit, "ge")), None)
    option = typer.Option(f"--{spelled.replace('_', '-')}", help=field.description, min=least)
    return inspect.Parameter(
        spelled, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=Annotated[annotation, option]
    )
