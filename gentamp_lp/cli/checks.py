"""The commands that check: `validate`, `check`, `schema`, `doctor`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from gentamp_lp.base.version import __version__
from gentamp_lp.cli.options import JsonOpt, TrustOpt
from gentamp_lp.cli.output import messages, print_json, say
from gentamp_lp.errors import Diagnostic, InputError, NoAnswer


def validate(
    file: Annotated[Path, typer.Argument(help="File of `solve --out` or `synthesize --out`, or a policy bundle.")],
    json_: JsonOpt = False,
    trust: TrustOpt = False,
) -> None:
    """Check a plan (symbolically and by replaying its motions in PyBullet) or the certificate of a policy.

    A certificate is a policy bundle of `learn`, or the file that `synthesize --out` writes.

    Example: `gentamp-lp validate plan.json`
    """
    from gentamp_lp.cli.documents import ValidateReport
    from gentamp_lp.plans.plan import Plan
    from gentamp_lp.plans.validate import validate as check
    from gentamp_lp.policy.policy import Policy
    from gentamp_lp.synthesis.certificate import check as check_certificate
    from gentamp_lp.synthesis.certificate import load_certificate
    from gentamp_lp.tasks.task import Task

    if file.is_dir():
        problems = Policy.load(file).check()
    elif (document := load_certificate(file)) is not None:
        problems = check_certificate(document)
    else:
        plan = Plan.load(file)
        problems = check(plan, Task.load(plan.task, trust=trust))
    if json_:
        print_json(ValidateReport(file=str(file), valid=not problems, problems=problems).dump())
    else:
        say("\n".join(problems) if problems else f"{file}: valid")
    if problems:
        raise typer.Exit(1)


def check(
    files: Annotated[
        list[Path],
        typer.Argument(metavar="FILE...", help="Task files (.yaml), domains (folder), grammars (.lp, Prolog)."),
    ],
    json_: JsonOpt = False,
    trust: TrustOpt = False,
) -> None:
    """Look for mistakes in tasks, domains and grammar files; prints `file:line: message`.

    A .lp file is read as a grammar, which is Prolog; the ASP files of that name (policy.lp, problems of
    `gentamp-lp synthesize`) are no grammars.

    Example: `gentamp-lp check tasks/*.yaml my_rules.lp`
    """
    from gentamp_lp.cli.documents import CheckReport
    from gentamp_lp.features.pool import check_grammars
    from gentamp_lp.tasks.domain_folder import load_domain
    from gentamp_lp.tasks.task import Task

    found: list[Diagnostic] = []
    for file in files:
        try:
            if file.is_dir():
                load_domain(str(file), trust=trust)
            elif file.suffix == ".lp":
                check_grammars([file])
            else:
                loaded = Task.load(file, trust=trust)
                loaded.instance(loaded.file.train[0], seed=0)  # the scene can be drawn, the samplers fit the streams
        except InputError as error:
            found += error.diagnostics
        except NoAnswer as error:
            found.append(Diagnostic(str(error), file))
    if json_:
        print_json(CheckReport(files=[str(f) for f in files], errors=[str(d) for d in found]).dump())
    for diagnostic in found:
        messages.print(str(diagnostic))
    if found:
        raise typer.Exit(2)
    if not json_:
        say(f"{len(files)} file(s): no mistakes found")


def schema(
    name: Annotated[
        str | None, typer.Argument(metavar="NAME", help="Format; without it, their names.", show_default=False)
    ] = None,
) -> None:
    """Print the JSON Schema of a file format or of what a command prints with `--json`.

    Example: `gentamp-lp schema task > task.schema.json`
    """
    from gentamp_lp.cli.schemas import FORMATS
    from gentamp_lp.cli.schemas import schema as of

    if name is None:
        for known, (_, about) in FORMATS.items():
            say(f"{known:11}  {about}")
    elif name in FORMATS:
        print_json(of(name))
    else:
        raise InputError(Diagnostic(f"unknown format `{name}`", hint=f"one of {', '.join(FORMATS)}"))


def doctor(json_: JsonOpt = False) -> None:
    """Say what is installed, where it was found, and how to get what is missing."""
    from gentamp_lp.cli.doctor import examine
    from gentamp_lp.cli.documents import DoctorReport

    findings = examine()
    if json_:
        print_json(DoctorReport(ok=all(f.ok for f in findings), version=__version__, findings=findings).dump())
    else:
        say(f"gentamp-lp {__version__}")
        for finding in findings:
            say(f"{'ok     ' if finding.ok else 'MISSING'} {finding.name}: {finding.detail}")
            if not finding.ok:
                say(f"        hint: {finding.remedy}")
    if not all(f.ok for f in findings):
        raise typer.Exit(2)
