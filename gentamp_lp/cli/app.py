"""The application to which the commands belong."""

from __future__ import annotations

import os
from typing import Annotated

import typer

from gentamp_lp.base.version import __version__
from gentamp_lp.cli.output import say
from gentamp_lp.errors import Diagnostic, InputError

app = typer.Typer(
    name="gentamp-lp",
    help="Learn a policy for a robot task from a few small problems, then plan any size with it.\n\n"
    "Start with `gentamp-lp learn unstack`, then `gentamp-lp solve unstack --size 16`.\n\n"
    "Exit codes: 0 done; 1 a true negative answer (no policy, no plan, plan invalid); 2 bad input; "
    "3 a limit was reached; 130 interrupted; 141 nobody reads the output.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode="markdown",
)


def _version(show: bool) -> None:
    if show:
        say(f"gentamp-lp {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    try:
        os.getcwd()
    except FileNotFoundError:
        raise InputError(Diagnostic("the current folder is gone", hint="go to one that is there: cd")) from None
