"""Which files are pages, and where code stands in them."""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]

# Pages that stand outside of docs/, and their names on the site.
BROUGHT = {
    "README.md": "readme",
    "ARCHITECTURE.md": "architecture",
    "CONTRIBUTING.md": "contributing",
    "CHANGELOG.md": "changelog",
    "tracks/README.md": "tracks",
    "lots/README.md": "lots",
    "agents/policies/README.md": "policies",
    "web/README.md": "web",
    "examples/driver_js/README.md": "driver-js",
    "examples/driver_cpp/README.md": "driver-cpp",
    "examples/policy_cpp/README.md": "policy-cpp",
    "examples/rllib/README.md": "rllib",
}

_FENCE = re.compile(r"^(`{3,})\s*(\{?[\w-]*\}?)[^`]*$")
_COMMENT = re.compile(r"^<!-- (not run|beside): (.+?) -->$")
_INLINE = re.compile(r"(?<!`)`([^`\n]+)`(?!`)")


@dataclass(frozen=True)
class Block:
    """A fenced block of code."""

    language: str
    text: str
    line: int  # of the fence, from 1
    reason: str = ""  # why it is not run
    beside: str = ""  # a command that runs beside it


@dataclass(frozen=True)
class Page:
    """A Markdown file, by its path from the root of the repository."""

    path: str
    text: str

    @classmethod
    def read(cls, path: str, root: Path = ROOT) -> "Page":
        """Return the page at a path."""
        return cls(path, (root / path).read_text(encoding="utf-8"))

    def blocks(self) -> list[Block]:
        """Return the fenced blocks in order, with what the comment above each says."""
        found = []
        lines = self.text.splitlines()
        number = 0
        while number < len(lines):
            fence = _FENCE.match(lines[number])
            if not fence:
                number += 1
                continue
            begin = number
            number += 1
            while number < len(lines) and lines[number].strip() != fence[1]:
                number += 1
            notes = dict(_notes_above(lines, begin))
            text = "\n".join(lines[begin + 1 : number]) + "\n"
            found.append(
                Block(fence[2], text, begin + 1, notes.get("not run", ""), notes.get("beside", ""))
            )
            number += 1
        return found

    def prose(self) -> Iterator[tuple[int, str]]:
        """Give all lines outside of fenced blocks, with their numbers from 1."""
        fence = ""
        for number, line in enumerate(self.text.splitlines(), 1):
            mark = _FENCE.match(line)
            if fence:
                fence = "" if line.strip() == fence else fence
            elif mark:
                fence = mark[1]
            else:
                yield number, line

    def inline_code(self) -> Iterator[tuple[int, str]]:
        """Give each `piece of code` in the prose, with the number of its line.

        A piece may go on in the next line of its paragraph.
        """
        paragraph: list[tuple[int, str]] = []
        for number, line in [*self.prose(), (0, "")]:
            if line.strip() and not line.lstrip().startswith("|"):
                paragraph.append((number, line))
                continue
            yield from _inline_in(paragraph)
            paragraph = []
            if line.strip():
                yield from _inline_in([(number, line)])


def _inline_in(paragraph: list[tuple[int, str]]) -> Iterator[tuple[int, str]]:
    text = " ".join(line.strip() for _, line in paragraph)
    ends, length = [], 0
    for number, line in paragraph:
        length += len(line.strip()) + 1
        ends.append((length, number))
    for match in _INLINE.finditer(text):
        yield next(number for end, number in ends if match.start() < end), match[1].strip()


def _notes_above(lines: list[str], fence: int) -> Iterator[tuple[str, str]]:
    above = fence - 1
    while above >= 0 and (not lines[above].strip() or lines[above].startswith("<!-- ")):
        note = _COMMENT.match(lines[above].strip())
        if note:
            yield note[1], note[2]
        above -= 1


def all_pages(root: Path = ROOT) -> list[Page]:
    """Return every page of the site that is written by hand."""
    docs = [
        path.relative_to(root).as_posix()
        for path in sorted((root / "docs").rglob("*.md"))
        if not {"generated", "_build"} & set(path.relative_to(root).parts)
    ]
    return [Page.read(path, root) for path in (*BROUGHT, *docs)]
