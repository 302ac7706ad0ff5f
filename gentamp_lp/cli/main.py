"""The command line: its commands, in order. Exit codes are those of `gentamp_lp.errors`."""

from __future__ import annotations

import sys

from gentamp_lp.cli.app import app
from gentamp_lp.cli.bench import bench
from gentamp_lp.cli.checks import check, doctor, schema, validate
from gentamp_lp.cli.features import features
from gentamp_lp.cli.learn import learn
from gentamp_lp.cli.output import messages, open_streams
from gentamp_lp.cli.policies import compile_, explain, report
from gentamp_lp.cli.solve import solve
from gentamp_lp.cli.synthesize import synthesize
from gentamp_lp.errors import Diagnostic, GentampError, InputError
from gentamp_lp.solvers.interrupts import send_swallowed_again

__all__ = ["app", "main"]

for command in (learn, solve, bench, synthesize, validate, features, explain, report):
    app.command()(command)
app.command("compile")(compile_)
for command in (check, schema, doctor):
    app.command()(command)


def main() -> None:
    """Entry point of the `gentamp-lp` command."""
    open_streams()
    send_swallowed_again()
    try:
        try:
            app()
        finally:
            sys.stdout.flush()  # while its failure can be reported
    except GentampError as error:
        messages.print(str(error) if isinstance(error, InputError) else f"error: {error}")
        sys.exit(error.exit_code)
    except RecursionError:
        messages.print("error: something in what was given is nested too deeply")
        sys.exit(InputError.exit_code)
    except OSError as error:
        if error.filename is None:
            raise
        messages.print(str(Diagnostic(str(error.strerror), error.filename, hint="check its name and permissions")))
        sys.exit(InputError.exit_code)
    except KeyboardInterrupt:
        messages.print("interrupted")
        sys.exit(130)
