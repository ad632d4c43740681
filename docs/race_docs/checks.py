"""What pages name must exist: commands, options, schema fields, Python names, files, tests."""

import ast
import importlib
import re
import shlex
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from race_docs.commands import command_tree, options_of
from race_docs.messages import members_by_type
from race_docs.pages import ROOT, Block, Page

# Languages of blocks that tests run, and of those that are not code.
RUN = {"python", "console", "toml"}
_RUN_WORDS = ", ".join(sorted(RUN))
NO_CODE = {"text", "{toctree}"}
# Options of other programs that pages speak of.
FOREIGN_OPTIONS = {"-c", "-e", "-k", "-n", "-m", "--no-deps", "--constraint"}

_DOTTED = re.compile(r"^(race_server|race_agents)(\.\w+)+")
_MEMBER = re.compile(r"^([A-Z]\w+)\.([a-z_A-Z]\w*)$")
_PLACE = re.compile(r"^([\w.-]+(?:/[\w.*-]+)*/?)(?::([A-Za-z_][\w.]*))?$")
_TOP = (
    "race_server",
    "agents",
    "schemas",
    "tracks",
    "lots",
    "tests",
    "web",
    "docs",
    "examples",
    ".ci",
)
_SUFFIXES = (".py", ".toml", ".fbs", ".md", ".ts", ".svelte", ".cpp", ".hpp")
_HISTORY = ("docs/design/",)  # what was true on the day of its date


@dataclass(frozen=True)
class Finding:
    """Something that a page names and that does not exist."""

    page: str
    line: int
    message: str


@dataclass
class Facts:
    """What there is to be named."""

    root: Path = ROOT
    commands: dict[tuple[str, ...], Any] = field(default_factory=command_tree)
    members: dict[str, set[str]] = field(default_factory=dict)
    tests: set[str] = field(default_factory=set)

    def __post_init__(self) -> None:
        """Read the schemas."""
        self.members = self.members or members_by_type(self.root)

    def has_test(self, name: str) -> bool:
        """Return whether there is a test of that name."""
        if not self.tests:
            for path in (self.root / "tests").rglob("test_*.py"):
                self.tests |= set(re.findall(r"^def (test_\w+)", path.read_text("utf-8"), re.M))
        return name in self.tests

    def all_options(self) -> set[str]:
        """Return the options of all commands together."""
        return {option for each in self.commands.values() for option in options_of(each)}


def check(page: Page, facts: Facts) -> list[Finding]:
    """Return what is wrong with a page."""
    found = [*_in_blocks(page, facts), *_in_prose(page, facts), *_in_tables(page, facts)]
    return [Finding(page.path, line, message) for line, message in found]


def _in_blocks(page: Page, facts: Facts) -> Iterator[tuple[int, str]]:
    for block in page.blocks():
        if block.language in NO_CODE:
            continue
        if block.language not in RUN and not block.reason:
            yield (
                block.line,
                (
                    f"block of {block.language or 'no language'!r}: tests run {_RUN_WORDS}; "
                    "write `<!-- not run: REASON -->` above it, or make it `text`"
                ),
            )
        if block.language == "python":
            for line, message in _imports_of(block):
                yield block.line + line, message
        elif block.language == "console":
            for line, command in commands_in(block):
                for part in re.split(r"\s(?:&&|\||;|&)(?:\s|$)", command):
                    if part.strip().startswith("race "):
                        for message in _wrong_in_command(part, facts):
                            yield block.line + line, message


def commands_in(block: Block) -> list[tuple[int, str]]:
    """Return the commands of a console block with their lines, counted from its fence."""
    found: list[tuple[int, str]] = []
    goes_on = False
    for number, line in enumerate(block.text.splitlines(), 1):
        if goes_on:
            found[-1] = (found[-1][0], found[-1][1].removesuffix("\\") + line.strip())
        elif line.startswith("$ "):
            found.append((number, line.removeprefix("$ ")))
        else:
            continue
        goes_on = line.endswith("\\")
    return found


def _wrong_in_command(command: str, facts: Facts) -> Iterator[str]:
    text = command.strip().removesuffix("…").strip()
    try:
        tokens = shlex.split(text, comments=True)
    except ValueError as error:
        yield f"`{command}`: {error}"
        return
    words: tuple[str, ...] = ()
    rest = tokens[1:]
    while rest and (*words, rest[0]) in facts.commands:
        words, rest = (*words, rest[0]), rest[1:]
    at = facts.commands[words]
    is_group = bool(getattr(at, "commands", {}))
    if is_group and rest and re.fullmatch(r"[a-z][a-z-]*", rest[0]):
        yield f"`{' '.join(('race', *words))}` has no command {rest[0]!r}"
        return
    if is_group:
        return
    known = options_of(at)
    for token in rest:
        option = token.partition("=")[0]
        if re.match(r"--?[a-z]", option) and option not in known:
            yield f"`race {' '.join(words)}` has no option {option}"


def _in_prose(page: Page, facts: Facts) -> Iterator[tuple[int, str]]:
    if page.path.startswith(_HISTORY):
        return
    for line, code in page.inline_code():
        for message in _wrong_in_code(code, page, facts):
            yield line, message


def _wrong_in_code(code: str, page: Page, facts: Facts) -> Iterator[str]:
    """Give what is wrong with a piece of code in the prose."""
    dotted, member = _DOTTED.match(code), _MEMBER.match(code)
    if code.startswith("race "):
        yield from _wrong_in_command(_one_of(code), facts)
    elif re.match(r"--[a-z]", code):
        option = re.split(r"[\s=]", code)[0]
        if option not in facts.all_options() | FOREIGN_OPTIONS:
            yield f"no command has the option {option}"
    elif re.fullmatch(r"test_\w+", code):
        if not facts.has_test(code):
            yield f"there is no test {code}"
    elif dotted:
        yield from filter(None, [_wrong_name(dotted[0])])
    elif member and member[1] in facts.members:
        if member[2] not in facts.members[member[1]]:
            yield f"the schema's {member[1]} has no {member[2]!r}"
    else:
        yield from filter(None, [_wrong_place(code, page, facts.root)])


def _one_of(code: str) -> str:
    """Return a command with alternatives, such as `list | check`, as one of them."""
    return re.sub(r"\s*\|.*", "", code)


def _in_tables(page: Page, facts: Facts) -> Iterator[tuple[int, str]]:
    """Check tables whose head says `field of Pose`: the first column names fields of it."""
    name = ""
    for line, text in page.prose():
        if not text.startswith("|"):
            name = ""
            continue
        cells = [cell.strip() for cell in text.strip("|").split("|")]
        head = re.fullmatch(r"field of `(\w+)`", cells[0])
        if head:
            name = head[1]
            if name not in facts.members:
                yield line, f"no schema has a type {name!r}"
            continue
        for code in re.findall(r"`(\w+)`", cells[0]) if name else ():
            if code not in facts.members.get(name, {code}):
                yield line, f"the schema's {name} has no field {code!r}"


def _imports_of(block: Block) -> Iterator[tuple[int, str]]:
    try:
        tree = ast.parse(block.text)
    except SyntaxError as error:
        yield error.lineno or 1, f"no Python: {error.msg}"
        return
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("race_"):
            for alias in node.names:
                message = _wrong_name(f"{node.module}.{alias.name}")
                if message:
                    yield node.lineno, message


def _wrong_name(dotted: str) -> str:
    """Return why a dotted name of ours means nothing; empty if it means something."""
    parts = dotted.split(".")
    value: Any = importlib.import_module(parts[0])
    for number, part in enumerate(parts[1:], 2):
        try:
            value = getattr(value, part)
        except AttributeError:
            try:
                value = importlib.import_module(".".join(parts[:number]))
            except ImportError:
                # An entry point's group has a name like a module's.
                if dotted in ("race_server.drivers", "race_server.commands", "race_server.kernels"):
                    return ""
                return f"there is no {'.'.join(parts[:number])}"
    return ""


def _wrong_place(code: str, page: Page, root: Path) -> str:
    """Return why a path or `path:symbol` is wrong; empty if it exists or is no path."""
    match = _PLACE.match(code)
    if not match:
        return ""
    path, symbol = match[1], match[2]
    is_ours = path.split("/")[0] in _TOP and "/" in path
    if not is_ours and not path.endswith(_SUFFIXES):
        return ""
    folders = (
        root,
        (root / page.path).parent,
        *(
            root / name
            for name in ("race_server", "agents", "docs", "web", "web/src", "tracks", "lots")
        ),
    )
    found = [place for folder in folders for place in sorted(folder.glob(path.rstrip("/")))]
    if not found:
        is_written = not is_ours and "/" not in path  # a file that a command writes
        return "" if is_written else f"there is no {path}"
    if symbol and not any(_defines(place, symbol) for place in found if place.is_file()):
        return f"{path} does not define {symbol}"
    return ""


def _defines(path: Path, symbol: str) -> bool:
    body: list[ast.stmt] = ast.parse(path.read_text(encoding="utf-8")).body
    for name in symbol.split("."):
        for node in body:
            if name in _names_of(node):
                body = getattr(node, "body", [])
                break
        else:
            return False
    return True


def _names_of(node: ast.stmt) -> set[str]:
    if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
        return {node.name}
    if isinstance(node, ast.Assign):
        return {each.id for each in node.targets if isinstance(each, ast.Name)}
    if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
        return {node.target.id}
    return set()
