"""A planning domain on disk: `domain.pddl`, `stream.pddl`, and the Python package beside them."""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gentamp_lp.base.reading import read_text
from gentamp_lp.base.shipped import resource
from gentamp_lp.errors import Diagnostic, GentampError, InputError, code_fault
from gentamp_lp.streams.pddl import Domain, parse_domain
from gentamp_lp.streams.stream_file import Stream, parse_streams
from gentamp_lp.tasks.domain_code import DomainCode, World


@dataclass(frozen=True)
class DomainFolder:
    """A loaded domain: its language and its Python code."""

    path: Path
    domain: Domain
    streams: tuple[Stream, ...]
    code: DomainCode


_LOADED: dict[Path, DomainFolder] = {}


def load_domain(name: str, beside: Path | None = None, *, trust: bool = False) -> DomainFolder:
    """Load a domain by path (relative to the task file's folder) or by the name of a shipped one.

    A domain's samplers are Python code: those of a stranger run only with `trust`. Raises InputError.
    """
    local = (beside / name) if beside else Path(name)
    shipped = resource("domains", name)
    path = (local if (local / "domain.pddl").is_file() else shipped).resolve()
    if not (path / "domain.pddl").is_file():
        known = ", ".join(sorted(p.parent.name for p in resource("domains").glob("*/domain.pddl")))
        raise InputError(
            Diagnostic(f"no domain `{name}`", hint=f"give a folder with a domain.pddl, or one of: {known}")
        )
    if path in _LOADED:
        return _LOADED[path]
    if path.parent != resource("domains").resolve() and not trust:
        raise InputError(
            Diagnostic("the samplers of this domain are Python code from outside gentamp-lp", path,
                       hint="read them, then pass --trust")
        )  # fmt: skip
    domain = parse_domain(read_text(path / "domain.pddl"), path / "domain.pddl")
    streams = parse_streams(read_text(path / "stream.pddl"), domain, path / "stream.pddl")
    for stream in streams:
        if stream.fluents:
            message = f"stream `{stream.name}` has `:fluents`, which tasks do not support"
            raise InputError(Diagnostic(message, path / "stream.pddl", stream.line, hint="use an axiom instead"))
    folder = DomainFolder(path, domain, streams, _import(path))
    _LOADED[path] = folder
    return folder


def check_stream_map(folder: DomainFolder, generators: Mapping[str, Any]) -> None:
    """Compare the declared streams with the ones that have Python code. Raises InputError."""
    declared = {s.name for s in folder.streams if s.kind != "rule"}
    problems = []
    for stream in (s for s in folder.streams if s.kind != "rule"):
        if stream.name not in generators:
            hint = f"add it to `stream_map` in {folder.path.name}, or remove the declaration"
            problems.append(
                Diagnostic(f"stream `{stream.name}` has no Python sampler", folder.path / "stream.pddl", stream.line,
                           hint=hint)
            )  # fmt: skip
    for name in sorted(set(generators) - declared):
        problems.append(
            Diagnostic(
                f"sampler `{name}` is not declared",
                folder.path / "stream.pddl",
                hint=f"declare (:stream {name} ...)",
            )
        )
    if problems:
        raise InputError(*problems)


@contextmanager
def running(folder: DomainFolder, function: str, *passing: type[Exception]) -> Iterator[None]:
    """Tell mistakes in the domain's Python code with their place, as InputError.

    What it raises on purpose passes, and so do what the system says of files, and the exceptions `passing`.
    """
    purposely: tuple[type[Exception], ...] = (GentampError, OSError, *passing)
    try:
        yield
    except purposely:
        raise
    except Exception as error:
        raise code_fault(f"`{function}` failed", error, folder.path) from error


def check_world(folder: DomainFolder, world: World) -> None:
    """Compare the facts of a drawn world with the domain's predicates. Raises InputError."""
    domain, names = folder.domain, world.values.keys() | set(folder.domain.constants)
    unchanging = domain.predicates.keys() - domain.fluents
    for kind, facts, allowed in (("static", world.static, unchanging), ("fluents", world.fluents, domain.fluents)):
        for fact in facts:
            if message := _misfit(domain, fact, allowed, names):
                text = f"`{kind}` of the world has the fact {fact!r}: {message}"
                raise InputError(Diagnostic(text, folder.path / "__init__.py", hint="see docs/domains.md"))


def _misfit(domain: Domain, fact: Any, allowed: Iterable[str], names: Iterable[str]) -> str | None:
    """Why a fact cannot be one of the initial state, or None if it can."""
    if not isinstance(fact, tuple) or not fact or not all(isinstance(part, str) for part in fact):
        return "facts are tuples of names that begin with a predicate"
    predicate, *args = fact
    if predicate not in domain.predicates:
        return f"`{predicate}` is not declared in domain.pddl"
    if predicate in domain.derived:
        return f"axioms derive `{predicate}`"
    if predicate not in allowed:
        return f"actions change `{predicate}`" if predicate in domain.fluents else f"no action changes `{predicate}`"
    if len(args) != (arity := domain.predicates[predicate].arity):
        return f"`{predicate}` takes {arity} argument(s)"
    unknown = [name for name in args if name not in names]
    return f"`values` has no `{unknown[0]}`" if unknown else None


def _import(path: Path) -> DomainCode:
    name = f"gentamp_domain_{path.name}"
    init = path / "__init__.py"
    spec = importlib.util.spec_from_file_location(name, init, submodule_search_locations=[str(path)])
    if spec is None or spec.loader is None or not init.is_file():
        raise InputError(Diagnostic("the domain has no Python package", init, hint="see docs/domains.md"))
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        del sys.modules[name]
        raise InputError(Diagnostic(f"the domain's Python code fails to load: {error!r}", init)) from error
    return DomainCode(module, init)
