"""What `mkdocs build` adds to the pages: references made from the sources, notebooks, and the files that pages link to.

Everything follows from the repository alone, in sorted order: the same sources give the same site.
"""

import json
import posixpath
import re
from pathlib import Path

import typer
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.exceptions import PluginError
from mkdocs.structure.files import File, Files, InclusionLevel
from mkdocs.structure.pages import Page
from typer.cli import get_docs_for_click

from gentamp_lp.cli.main import app
from gentamp_lp.cli.schemas import FORMATS, schema

ROOT = Path(__file__).parent.parent
LINK = re.compile(r"(?<=\]\()(?!https?:)[^)#\s]+(?=[)#])")
PLDOC = re.compile(r"((?:^%!.*\n)+)((?:^%(?!!).*\n)*)", re.MULTILINE)
SYMBOLS = re.compile(r"(\[`[^`]+`\]\(([^)]+)\))((?: `[^`]+`)+)")
ASP_DOC = re.compile(r"^%\*\n(.*?)\*%", re.MULTILINE | re.DOTALL)
ASP_SECTION = re.compile(r"^(Input|Output|Local): *\n((?:    .*\n)+)", re.MULTILINE)
ASP_PREDICATE = re.compile(r"^    (\S.*?)  +(\S.*(?:\n     +\S.*)*)", re.MULTILINE)
LANGUAGES = {".lp": "prolog", ".pl": "prolog", ".py": "python", ".yaml": "yaml", ".pddl": "lisp", ".urdf": "xml"}


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the generated pages: references, notebooks, and one for each file or folder that a page links to."""
    for name, make in {"cli": cli, "grammar": grammar, "asp": asp, "formats": formats}.items():
        files.append(File.generated(config, f"reference/{name}.md", content=make()))
    for file in list(files):
        if file.src_uri.endswith(".ipynb"):
            files.remove(file)
            files.append(File.generated(config, page_of(file.src_uri), content=notebook(file.content_string)))
    for path in sorted({path for file in files.documentation_pages() for path in linked(file, files)}):
        page = File.generated(config, f"source/{path}.md", content=source(path), inclusion=InclusionLevel.NOT_IN_NAV)
        files.append(page)
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Point links at the pages made for what they name."""
    if page.file.src_uri.startswith(("source/", "reference/")):
        return markdown
    folder = posixpath.dirname(page.file.src_uri)

    def shown(match: re.Match[str]) -> str:
        path = target(page.file, match[0])
        if path.startswith("docs/") and files.get_file_from_path(page_of(path.removeprefix("docs/"))):
            return page_of(match[0])
        return posixpath.relpath(f"source/{path}.md", folder or ".")

    return LINK.sub(shown, with_lines(markdown) if page.file.src_uri == "paper.md" else markdown)


def target(file: File, link: str) -> str:
    """The path in the repository of what a page links to."""
    return posixpath.normpath(posixpath.join("docs", posixpath.dirname(file.src_uri), link))


def page_of(uri: str) -> str:
    """The page of a file in docs: notebooks become Markdown."""
    return re.sub(r"\.ipynb$", ".md", uri)


def linked(file: File, files: Files) -> set[str]:
    """The files and folders of the repository, other than pages and pictures, that a page links to."""
    if file.src_uri.startswith("reference/"):
        return set()
    paths = {target(file, link) for link in LINK.findall(file.content_string)}
    for path in paths:
        if not (ROOT / path).exists():
            raise PluginError(f"{file.src_uri} links to {path}, which does not exist")
    return {
        p for p in paths if not (p.startswith("docs/") and files.get_file_from_path(page_of(p.removeprefix("docs/"))))
    }


def source(path: str) -> str:
    """A page with the text of a file, or of the files of a folder."""
    place = ROOT / path
    parts = [place] if place.is_file() else [part for part in sorted(place.iterdir()) if part.is_file()]
    text = [f"# `{path}`"]
    for part in parts:
        heading = [] if part == place else [f"## `{part.name}`"]
        text += [*heading, fence(part.read_text(encoding="utf-8"), LANGUAGES.get(part.suffix, "text"))]
    return "\n\n".join(text)


def fence(text: str, language: str = "text") -> str:
    """A code block."""
    return f"`````{language}\n{text.strip(chr(10))}\n`````"


def cli() -> str:
    """All commands with their options, as Typer knows them."""
    command = typer.main.get_command(app)
    text = get_docs_for_click(obj=command, ctx=typer.Context(command), name="gentamp-lp")
    return text.replace("# `gentamp-lp`\n", "# Commands\n", 1)


def grammar() -> str:
    """The predicates of grammar files from the head of grammar.lp, then the engine's from PlDoc comments."""
    head = re.match(r"(%.*\n)+", (ROOT / "logic" / "grammar.lp").read_text(encoding="utf-8"))[0]
    text = ["# Grammar predicates", "## What a grammar file may say", fence(re.sub(r"^% ?", "", head, flags=re.M))]
    for path in sorted((ROOT / "logic").glob("*.pl")):
        content = path.read_text(encoding="utf-8")
        about = re.search(r"/\*\* <module> (.*)\n((?:.*\n)*?)\*/", content)
        text += [f"## `logic/{path.name}`: {about[1]}", fence(about[2])]
        for heads, body in PLDOC.findall(content):
            text += [f"**`{head.strip()}`**" for head in re.findall(r"^%!(.*)$", heads, re.M)]
            text.append(fence(re.sub(r"^%(   )?", "", body, flags=re.M)))
    return "\n\n".join(text)


def asp() -> str:
    """The predicates of each ASP program, its own comment, and those of its files."""
    text = ["# ASP predicates"]
    for program in sorted((ROOT / "asp").glob("*.lp")):
        text += [f"## `asp/{program.name}`", fence(asp_comment(program))]
        files = sorted((ROOT / "asp" / program.stem).glob("*.lp"))
        rows = sorted((name, what, path.name, role) for path in files for name, what, role in asp_predicates(path))
        if rows:
            lines = [f"| `{name}` | {what} | {role.lower()}, `{file}` |" for name, what, file, role in rows]
            text.append("\n".join(["| predicate | meaning | |", "|---|---|---|", *lines]))
        for path in files:
            text += [f"### `asp/{program.stem}/{path.name}`", fence(asp_comment(path))]
    return "\n\n".join(text)


def asp_comment(path: Path) -> str:
    """What an ASP file says about itself."""
    about = ASP_DOC.search(path.read_text(encoding="utf-8"))
    if about is None:
        raise PluginError(f"{path.relative_to(ROOT)} has no comment that says what it is for")
    return about[1]


def asp_predicates(path: Path) -> list[tuple[str, str, str]]:
    """The predicates that an ASP file explains: with arguments, meaning, and Input, Output or Local."""
    return [
        (name, " ".join(what.split()), role)
        for role, lines in ASP_SECTION.findall(asp_comment(path))
        for name, what in ASP_PREDICATE.findall(lines)
    ]


def formats() -> str:
    """The JSON Schemas of files and outputs."""
    text = ["# File formats", "As JSON Schemas; `gentamp-lp schema NAME` prints one."]
    for name, (_, about) in FORMATS.items():
        text += [f"## {name}", f"{about}.", fence(json.dumps(schema(name), indent=2, ensure_ascii=False), "json")]
    return "\n\n".join(text)


def notebook(text: str) -> str:
    """A notebook's cells and their text, picture and SVG outputs."""
    parts = []
    for cell in json.loads(text)["cells"]:
        body = "".join(cell["source"])
        parts.append(body if cell["cell_type"] == "markdown" else fence(body, "python"))
        for output in cell.get("outputs", ()):
            data = output.get("data", {"text/plain": output.get("text", "")})
            svg = "".join(data.get("image/svg+xml", ""))
            parts.append(svg.replace("\n", " ") or fence("".join(data.get("text/plain", ""))))
    return "\n\n".join(parts)


def line_of(path: Path, symbol: str) -> int | None:
    """The line where a file defines a symbol: a class, function or method, a rule or predicate, a PDDL or YAML name."""
    text, end = path.read_text(encoding="utf-8"), 0
    for name in map(re.escape, symbol.split(".")):
        python = (rf"^ *(?:class|def) {name}\b", rf"^{name}\b.* = ")
        other = (rf"^rule\({name},", rf"^(?!%)[^;\n]*(?<![\w-]){name}(?![\w-])")
        patterns = python if path.suffix == ".py" else other
        match = next(filter(None, (re.compile(p, re.MULTILINE).search(text, end) for p in patterns)), None)
        if match is None:
            return None
        end = match.end()
    return text.count("\n", 0, end) + 1


def with_lines(text: str) -> str:
    """Add lines to the symbols that follow links to sources, as in [`file`](../file) `symbol`."""

    def lines(match: re.Match[str]) -> str:
        found = {symbol: line_of(ROOT / "docs" / match[2], symbol) for symbol in re.findall(r"`(.+?)`", match[3])}
        if None in found.values():
            raise PluginError(f"{match[2]} does not define {[s for s, line in found.items() if line is None]}")
        return match[1] + "".join(f" `{symbol}`:{line}" for symbol, line in found.items())

    return SYMBOLS.sub(lines, text)
