"""The reference of the messages, from the schemas and their comments."""

import re
from dataclasses import dataclass, field
from pathlib import Path

from race_docs.pages import ROOT

_TYPE = re.compile(
    r"^(table|struct|enum|union)\s+(\w+)\s*(?::\s*([\w.]+))?\s*(\([^)]*\))?\s*\{(.*)$"
)
_FIELD = re.compile(
    r"^(\w+)\s*:\s*(\[?[\w.]+(?::\d+)?\]?)\s*(=\s*[\w.+-]+)?\s*(\([^)]*\))?;\s*(?://+\s*(.*))?$"
)
_VALUE = re.compile(r"^(\w+)\s*(=\s*\d+)?\s*,?\s*(?://+\s*(.*))?$")


@dataclass
class Member:
    """A field of a message, or a value of an enumeration."""

    name: str
    kind: str  # type of the field, number of the value
    note: str = ""


@dataclass
class Message:
    """A table, struct or enumeration."""

    sort: str
    name: str
    namespace: str
    note: str = ""
    members: list[Member] = field(default_factory=list)


def read_schema(text: str) -> tuple[str, list[Message]]:
    """Return what a schema says of itself, and its types in order."""
    reader = _Reader()
    for line in text.splitlines():
        reader.read(line.strip())
    return reader.introduction, reader.messages


class _Reader:
    """Takes the lines of a schema one by one."""

    def __init__(self) -> None:
        self.introduction = ""
        self.messages: list[Message] = []
        self._namespace = ""
        self._comments: list[str] = []
        self._open: Message | None = None

    def read(self, line: str) -> None:
        """Take the next line, without blanks around it."""
        if self._open is not None:
            self._read_member(self._open, line)
        elif line.startswith("//"):
            self._comments.append(line.lstrip("/").strip())
        elif line:
            if line.startswith(("namespace", "include")):
                self.introduction = self.introduction or " ".join(self._comments).strip()
            if line.startswith("namespace"):
                self._namespace = line.removeprefix("namespace").strip(" ;")
            opened = _TYPE.match(line)
            if opened:
                self._begin(opened)
            self._comments = []

    def _begin(self, opened: re.Match[str]) -> None:
        sort, name, _, attributes, rest = opened.groups()
        notes = [*self._comments, (attributes or "").strip("()")]
        identifier = re.search(r"identifier (\w+)", rest)
        if identifier:
            notes.append(f"Identifier `{identifier[1]}`.")
        message = Message(sort, name, self._namespace, " ".join(filter(None, notes)))
        self.messages.append(message)
        values, brace, _ = rest.partition("}")
        for value in values.split(",") if brace else ():
            _add_value(message, value.strip())
        self._open = None if brace else message

    def _read_member(self, message: Message, line: str) -> None:
        match = _FIELD.match(line)
        if line.startswith("}"):
            self._open = None
        elif line.startswith("//"):
            # A comment goes on in the next line.
            if message.members:
                message.members[-1].note += f" {line.lstrip('/').strip()}"
        elif message.sort == "enum":
            _add_value(message, line)
        elif match:
            kind = match[2] + (f" {match[3].strip()}" if match[3] else "")
            kind += " (required)" if match[4] and "required" in match[4] else ""
            message.members.append(Member(match[1], kind, match[5] or ""))
        elif line:
            raise ValueError(f"{message.namespace}.{message.name}: no field of a schema: {line!r}")


def _add_value(message: Message, line: str) -> None:
    match = _VALUE.match(line)
    if match:
        number = match[2].strip("= ") if match[2] else str(_next_number(message))
        message.members.append(Member(match[1], number, match[3] or ""))


def _next_number(message: Message) -> int:
    return int(message.members[-1].kind) + 1 if message.members else 0


def all_schemas(root: Path = ROOT) -> dict[str, tuple[str, list[Message]]]:
    """Return what `read_schema` says of each file in `schemas/`, by its name."""
    return {
        path.name: read_schema(path.read_text(encoding="utf-8"))
        for path in sorted((root / "schemas").glob("*.fbs"))
    }


def members_by_type(root: Path = ROOT) -> dict[str, set[str]]:
    """Return the names of fields and values by the name of their type, in all schemas together."""
    found: dict[str, set[str]] = {}
    for _, messages in all_schemas(root).values():
        for message in messages:
            found.setdefault(message.name, set()).update(each.name for each in message.members)
    return found


def messages_page(root: Path = ROOT) -> str:
    """Return the page of all messages and their fields."""
    parts = [
        "# Messages\n",
        "Every table, struct and enumeration of `schemas/`. Messages are FlatBuffers; the key of "
        "each on the network is in `race_server/net/wire/topics.py`.\n",
    ]
    for name, (introduction, messages) in all_schemas(root).items():
        parts += [f"## {name}\n", f"{_cell(introduction)}\n"]
        for message in messages:
            parts.append(f"### {message.name} ({message.sort}, {message.namespace})\n")
            parts.append(f"{_cell(message.note)}\n")
            head = ("field", "type")
            if message.sort == "enum":
                head = ("value", "bit" if "bit_flags" in message.note else "number")
            parts.append(f"| {head[0]} | meaning | {head[1]} |\n|---|---|---|")
            parts.append(
                "".join(
                    f"| `{each.name}` | {_cell(each.note)} | `{each.kind}` |\n"
                    for each in message.members
                )
            )
    return "\n".join(parts)


def _cell(text: str) -> str:
    return " ".join(text.replace("|", "\\|").replace("<", "&lt;").split())
