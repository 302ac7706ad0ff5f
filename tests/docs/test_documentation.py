"""All of the documentation is run, or says why not; the site builds; notebooks still print the same."""

import importlib.util
import os
import subprocess
import sys
from pathlib import Path

import nbformat
import pytest
from helpers.documentation import ROOT, RUN, SHOWN, blocks, follow, matches, pages, quoted
from helpers.prose import sentences, words
from nbclient import NotebookClient

CONCEPTS = ["features", "abstraction", "termination", "constrained"]
QUICK = {f"docs/{page}.md" for page in ("first-policy", "reading", "streams", "synthesis", *CONCEPTS)}
QUICK |= {str(page.relative_to(ROOT)) for page in (ROOT / "docs/examples/06-own-domain").rglob("*.md")}
PROSE = [*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md"), *ROOT.glob("domains/**/*.md")]
LONG = 35  # words of a sentence
GUIDES = ["first-policy", "reading", "tasks", "domains", "robots", "streams", "synthesis", "cluster"]


def name(page: Path) -> str:
    return str(page.relative_to(ROOT))


@pytest.mark.parametrize("page", pages(), ids=name)
def test_every_block_is_run_or_says_why_not(page: Path) -> None:
    for block in blocks(page):
        assert block.language in RUN | SHOWN, f"a block without a language: {block.text[:60]}"
        if block.excuse == "quoted":
            assert quoted(block), f"{block.reason} does not have these lines: {block.text}"
        runs = block.language in ("console", "sh", "python")
        assert runs or block.language in SHOWN or block.title or block.excuse, f"not run: {block.text[:60]}"


@pytest.mark.parametrize("page", sorted(PROSE), ids=name)
def test_sentences_are_short(page: Path) -> None:
    found = sentences(page.read_text(encoding="utf-8"))
    assert found, "no prose"
    assert not [f"{words(s)} words: {s}" for s in found if words(s) >= LONG]


def test_what_counts_as_a_sentence() -> None:
    page = """# A title. Of two
Code such as `a b` counts, [and links](https://example.org/a.b), e.g. This one. The (second.) 3 is third?
No: it is one of Curtis et al. 2022 ... Still the same! <!-- not: A sentence. --> ![nor. A](picture.png)
- an item
  goes on. Twice
1. another; the last

| not. A | table |
|---|---|

```text
Not. This
```
> quoted
"""
    assert sentences(page) == [
        "A title.", "Of two", "Code such as `a b` counts, and links, e.g. This one.", "The (second.)", "3 is third?",
        "No: it is one of Curtis et al. 2022 ... Still the same!", "an item goes on.", "Twice", "another; the last",
        "quoted",
    ]  # fmt: skip
    assert [words(s) for s in sentences(page)] == [2, 2, 11, 2, 3, 12, 4, 1, 3, 1]


@pytest.mark.parametrize(
    "page", [p if name(p) in QUICK else pytest.param(p, marks=pytest.mark.slow) for p in pages()], ids=name
)
def test_following_the_page_works(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    follow(page, tmp_path)


@pytest.mark.slow
def test_the_guides_work_in_a_fresh_environment(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The wheel is installed into an empty environment, with nothing of this one in sight."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.delenv("PYTHONPATH", raising=False)
    build = [sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir", str(tmp_path), str(ROOT)]
    subprocess.run(build, check=True, capture_output=True)
    (wheel,) = tmp_path.glob("*.whl")
    subprocess.run([sys.executable, "-m", "venv", str(tmp_path / "fresh")], check=True)
    programs = tmp_path / "fresh" / "bin"
    subprocess.run([programs / "pip", "install", "--quiet", f"{wheel}[bench]"], check=True)
    for guide in GUIDES:
        folder = tmp_path / guide
        folder.mkdir()
        follow(ROOT / "docs" / f"{guide}.md", folder, {"PATH": f"{programs}{os.pathsep}{os.environ['PATH']}"})


@pytest.mark.parametrize("path", sorted((ROOT / "docs" / "notebooks").glob("*.ipynb")), ids=lambda path: path.stem)
def test_a_notebook_prints_what_it_shows(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    shown, run = nbformat.read(path, 4), nbformat.read(path, 4)
    assert str(ROOT) not in path.read_text(encoding="utf-8") and "/home" not in path.read_text(encoding="utf-8")
    NotebookClient(run, timeout=600, kernel_name="python3").execute()
    for before, after in zip(shown.cells, run.cells, strict=True):
        assert before.get("outputs") == after.get("outputs"), before.source


def test_the_site_builds_without_a_warning(tmp_path: Path) -> None:
    """Broken links, unknown anchors, symbols of docs/paper.md that are gone and pages outside the menu are warnings."""
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "--site-dir", str(tmp_path / "site")]
    run = subprocess.run(command, cwd=ROOT, env={**os.environ, "PYTHONPATH": str(ROOT)}, capture_output=True, text=True)
    assert run.returncode == 0, run.stdout + run.stderr
    loaded = [
        page.name for page in (tmp_path / "site").rglob("*.html") if 'src="http' in page.read_text(encoding="utf-8")
    ]
    assert not loaded, "the site works without a network"
    assert "uniqueness" in (tmp_path / "site" / "pool.html").read_text(encoding="utf-8")
    for page in ("cli", "api", "grammar", "asp", "formats"):
        assert (tmp_path / "site" / "reference" / f"{page}.html").stat().st_size > 10_000


def test_a_symbol_that_is_gone_is_noticed() -> None:
    spec = importlib.util.spec_from_file_location("hooks", ROOT / "docs" / "hooks.py")
    hooks = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(hooks)
    assert hooks.line_of(ROOT / "gentamp_lp" / "learning" / "learned.py", "Learned.report") > 40
    assert hooks.line_of(ROOT / "logic" / "grammar.lp", "conj") > 100
    assert hooks.line_of(ROOT / "gentamp_lp" / "learning" / "learned.py", "Learned.gone") is None
    with pytest.raises(Exception, match="gone"):
        hooks.with_lines("[`x`](../gentamp_lp/learning/learn.py) `gone`")


def test_what_counts_as_the_same_output() -> None:
    assert matches("a\n...\n2 steps; 0.05 s\n", "a\nb\n2 steps;  1.25 s")
    assert not matches("2 steps; 0.05 s\n", "3 steps; 0.05 s\n")
