"""Every program loads without a warning, and every file says what it is for."""

import pytest

from gentamp_lp.base.shipped import resource
from gentamp_lp.solvers.asp import GroundProgram

ENTRIES = ("abstraction.lp", "explanation.lp", "reference.lp", "synthesis.lp", "qnp.lp", "certificate.lp", "policy.lp")
FILES = sorted(
    path
    for folder in ("", "abstraction", "reference", "synthesis", "qnp", "certificate")
    for path in resource("asp", folder).glob("*.lp")
    if folder or path.name in ENTRIES
)


@pytest.mark.parametrize("name", ENTRIES)
def test_no_warning(name):
    program = GroundProgram([resource("asp", name)], "")
    assert program.messages == []


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name)
def test_header(path):
    text = path.read_text()
    assert text.startswith("%*\n")
    header = text[: text.index("*%")]
    assert "Purpose:" in header
    assert "Input:" in header or "Used:" in header or "Output:" in header
    assert all(len(line) <= 110 for line in text.splitlines())


def test_every_concern_is_in_an_entry_file():
    entries = "".join(resource("asp", name).read_text() for name in ENTRIES)
    for path in FILES:
        assert path.parent.name == "asp" or f'"{path.parent.name}/{path.name}"' in entries
