"""Prose of the project: plain technical English, without words that only its authors understand."""

import io
import re
import tokenize
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
FOLDERS = ("race_server", "agents", "examples", "tests", "docs", "tracks", "lots", "web/src")
SUFFIXES = {".py", ".md", ".toml"}
GENERATED = ("race_server/net/wire/generated/", "docs/results/", "docs/generated/", "docs/_build/")

# What to write instead: again, the driver, no driver, at most N, record, separate, timeout, resume,
# receive, publish, reconnect, snapshot, bundled, random.
PHRASES = (
    "anew",
    "whoever",
    "whomever",
    "nobody",
    "somebody",
    "anybody",
    "so many",
    "so often",
    "so long",
    "of its own",
    "of their own",
    "of one's own",
    "tak(?:e|es|en|ing) note",
    "took note",
    "knows? nothing",
    "lest",
    "heeds?",
    "stumbles?",
    "at (?:its|the|his) wheel",
    "comes? along",
    "by lot",
    "by chance",
    "put to the proof",
    "what (?:has )?(?:came|come|became|become) of",
    "who (?:is|was|has|does|drives|sits|stands|brakes|crashed|finished)",
    "all the same",
    "dearer",
    "dearest",
    "in good time",
    "loses? its patience",
    "two halls",
    "full hall",
)
PATTERN = re.compile(rf"\b(?:{'|'.join(PHRASES)})\b", re.IGNORECASE)


def pages() -> list[Path]:
    """Return all files with prose, without those that are made by programs."""
    found = list(ROOT.glob("*.md"))
    for folder in FOLDERS:
        found += [path for path in (ROOT / folder).rglob("*") if path.suffix in SUFFIXES]
    return sorted(path for path in found if not name_of(path).startswith(GENERATED))


def name_of(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


def prose_of(path: Path) -> Iterator[tuple[int, str]]:
    """Yield number and text of lines with prose: of Python its comments and its strings.

    A string without a space is a name, not prose.
    """
    text = path.read_text(encoding="utf-8")
    if path.suffix != ".py":
        yield from enumerate(text.splitlines(), start=1)
        return
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        is_string = token.type == tokenize.STRING and " " in token.string
        if is_string or token.type == tokenize.COMMENT:
            yield from enumerate(token.string.splitlines(), start=token.start[0])


def findings(path: Path) -> list[str]:
    return [
        f"{name_of(path)}:{number}: {match.group()!r} in {line.strip()}"
        for number, line in prose_of(path)
        for match in PATTERN.finditer(line)
    ]


def test_prose_is_plain_english() -> None:
    paths = pages()
    assert len(paths) > 100
    found = [line for path in paths if path != Path(__file__) for line in findings(path)]
    assert not found, "\n".join(found)


def test_a_swept_file_is_not_on_the_list() -> None:
    """Every file of Python is read, without a list of exceptions, but for the generated codec."""
    read = {name_of(path) for path in pages()}
    for folder in ("race_server", "agents", "examples", "tests"):
        files = {name_of(path) for path in (ROOT / folder).rglob("*.py")}
        left_out = {name for name in files - read if "wire/generated/" not in name}
        assert not left_out
    # The one file that may hold the phrases shows that the sweep finds them.
    assert len(findings(Path(__file__))) > 10


@pytest.mark.parametrize(
    "line", ["# Begin anew.", 'x = "Nobody knows this."', '"""Take note of it."""', "# So Many."]
)
def test_comments_strings_and_docstrings_are_prose(line: str, tmp_path: Path) -> None:
    page = tmp_path / "page.py"
    page.write_text(f"{line}\n", encoding="utf-8")
    lines = [text for _, text in prose_of(page)]
    assert any(PATTERN.search(text) for text in lines)


def test_help_texts_are_prose() -> None:
    lines = {text for _, text in prose_of(ROOT / "race_server/cli/serve_options.py")}
    assert any("Exit after one race." in line for line in lines)


def test_a_name_is_no_prose(tmp_path: Path) -> None:
    page = tmp_path / "page.py"
    page.write_text("nobody = 'anew'\n", encoding="utf-8")
    assert list(prose_of(page)) == []
