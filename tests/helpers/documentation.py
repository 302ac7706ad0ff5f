"""The code blocks of the documentation, and following a page literally in a folder.

A block is run, or its page says why not in a comment before it:
    <!-- not run: REASON -->     output, a synopsis, something that changes the system
    <!-- quoted: PATH -->        lines of a file of the repository, in this order
Of ```console blocks each line that starts with `$ ` is a command, what follows is its output, where `...` stands for
anything and decimal numbers (times) may differ. A block with title="NAME" is saved under that name; blocks of the same
name are put together. ```python blocks are run as scripts. ```text is what something printed or a drawing.
"""

import os
import re
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
RUN, SHOWN = {"console", "sh", "python", "yaml", "prolog", "lisp", "json"}, {"text"}
_BLOCK = re.compile(
    r"(?:<!-- (not run|quoted): ([^>]+) -->\n)?^```([\w-]*)(?: title=\"([\w./-]+)\")?\n(.*?)^```$", re.M | re.S
)
_COMMAND = re.compile(r"^\$ ((?:.*\\\n)*.*)\n((?:(?!\$ ).*\n)*)", re.M)


@dataclass(frozen=True)
class Block:
    language: str
    text: str
    title: str | None
    excuse: str | None
    reason: str | None


def pages() -> list[Path]:
    found = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
    return [page for page in found if blocks(page)]


def blocks(page: Path) -> list[Block]:
    return [
        Block(language, text, title or None, excuse or None, reason or None)
        for excuse, reason, language, title, text in _BLOCK.findall(page.read_text(encoding="utf-8"))
    ]


def follow(page: Path, folder: Path, environment: dict[str, str] | None = None) -> None:
    """Do what the page says in a folder from which the documentation's examples can be seen."""
    for name in ("docs", "tasks", "domains"):
        (folder / name).symlink_to(ROOT / name)
    environment = {**os.environ, "NO_COLOR": "1", "COLUMNS": "100", **(environment or installed(folder))}
    for block in blocks(page):
        if block.title:
            with (folder / block.title).open("a", encoding="utf-8") as file:
                file.write(block.text)
        elif block.excuse is None and block.language in ("console", "sh"):
            for command, shown in _COMMAND.findall(block.text):
                check(command, shown, folder, environment)
        elif block.excuse is None and block.language == "python":
            (folder / "block.py").write_text(block.text, encoding="utf-8")
            check("python block.py", "", folder, environment)


def installed(folder: Path) -> dict[str, str]:
    """An environment in which `gentamp-lp` and `python` are those of this test."""
    programs = folder / ".bin"
    programs.mkdir()
    for name, arguments in {"gentamp-lp": "-m gentamp_lp", "python": "", "dask": "-m dask"}.items():
        script = programs / name
        script.write_text(f'#!/bin/sh\nexec "{sys.executable}" {arguments} "$@"\n', encoding="utf-8")
        script.chmod(0o755)
    return {"PATH": f"{programs}{os.pathsep}{os.environ['PATH']}", "PYTHONPATH": str(ROOT)}


def check(command: str, shown: str, folder: Path, environment: dict[str, str]) -> None:
    run = subprocess.run(
        ["bash", "-c", command], cwd=folder, env=environment, capture_output=True, text=True, timeout=900
    )
    assert run.returncode == 0 or (shown and run.returncode == 1), f"{command}\n{run.stdout}{run.stderr}"
    if shown:
        assert matches(shown, run.stdout), f"{command}\nprints\n{run.stdout}\nand not\n{shown}"


def matches(shown: str, printed: str) -> bool:
    pattern = re.escape(normal(shown)).replace(r"\.\.\.", ".*")
    return re.fullmatch(pattern, normal(printed), re.S) is not None


def normal(text: str) -> str:
    """Without times, and without what differs only in blanks."""
    return re.sub(r"\s+", " ", re.sub(r"\d+\.\d+", "0.0", text)).strip()


def quoted(block: Block) -> bool:
    """Whether the lines of a block stand in the file that it quotes, in this order (comments may differ)."""
    lines = iter(map(bare, (ROOT / str(block.reason)).read_text(encoding="utf-8").splitlines()))
    return all(line in lines for line in map(bare, block.text.splitlines()) if line and line != "...")


def bare(line: str) -> str:
    return re.sub(r"\s+", " ", re.sub(r"(^|\s)[#%;].*", "", line)).strip()
