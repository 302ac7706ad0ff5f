"""The sentences of a Markdown page: no code blocks, tables, comments, pictures or targets of links.

Code spans and the texts of links count with the words they have. The ends of headings, list items and paragraphs end a
sentence, and so does a full stop, a question mark or an exclamation mark before what can start the next one.
"""

import re

_LEFT_OUT = re.compile(r"^(`{3,})[^\n]*\n(?s:.*?)^\1$|<!--(?s:.*?)-->|^ *\|.*$|^:::.*$", re.MULTILINE)
_PICTURE = re.compile(r"!\[[^\]]*\]\([^)]*\)|<[a-z/][^>]*>")
_LINK = re.compile(r"\[([^\]]*)\]\([^)]*\)")
_BLOCK = re.compile(r"\n\s*\n|(?<=\n)(#+ [^\n]*)\n|\n(?=[ \t]*(?:[-*+]|\d+\.) )")
_MARK = re.compile(r"^\s*(?:#+|[-*+>]|\d+\.) ")
_ABBREVIATION = re.compile(r"(?:\b(?:e\.g|i\.e|et al|etc|vs|cf)|\.\.)\.$")
_END = re.compile(r"[.!?][)\"*_]*(?=\s+[\"(*_]*[A-Z0-9`¬∃∀])")
_WORD = re.compile(r"\w")


def sentences(text: str) -> list[str]:
    """Return the sentences of a page in their order, each on one line."""
    prose = _LINK.sub(r"\1", _PICTURE.sub("", _LEFT_OUT.sub("\n", "\n" + text)))
    return [sentence for block in _BLOCK.split(prose) if block for sentence in _split(_MARK.sub("", block))]


def words(sentence: str) -> int:
    """Return the number of words: what stands between blanks and has a letter or a digit."""
    return sum(bool(_WORD.search(word)) for word in sentence.split())


def _split(block: str) -> list[str]:
    found, start, text = [], 0, " ".join(block.split())
    for match in _END.finditer(text):
        if not _ABBREVIATION.search(text[: match.start() + 1]):
            found.append(text[start : match.end()].strip())
            start = match.end()
    return [sentence for sentence in (*found, text[start:].strip()) if sentence]
