"""The reference of a training's settings, from the classes that read them."""

import ast
import io
import tokenize
from pathlib import Path

from race_docs.pages import ROOT

SOURCES = "agents/training/*settings.py"
PRESETS = "agents/training/presets"


def settings_page(root: Path = ROOT) -> str:
    """Return the page of all tables and keys of a training's TOML file."""
    source = "\n".join(path.read_text(encoding="utf-8") for path in sorted(root.glob(SOURCES)))
    comments = _comments_in(source)
    classes = {node.name: node for node in ast.parse(source).body if isinstance(node, ast.ClassDef)}
    tables = _tables_of(classes)
    parts = [
        "# Settings of a training\n",
        "The keys of the TOML file that `race train` reads, and of `race train --set KEY=VALUE`. "
        f"Presets are in `{PRESETS}/`; [Training](../training.md) says what they do.\n",
    ]
    for name, heading in tables.items():
        node = classes[name]
        parts.append(f"## {heading}\n")
        parts.append(f"{_cell(ast.get_docstring(node) or '')}\n")
        parts.append("| key | meaning | default | type |\n|---|---|---|---|")
        parts.append("".join(_row(field, comments) for field in _fields(node)))
    return "\n".join(parts)


def _tables_of(classes: dict[str, ast.ClassDef]) -> dict[str, str]:
    """Return the heading of each class: its place in the TOML file."""
    found = {"Settings": "Top level"}
    for field in _fields(classes["Settings"]):
        kinds = {each.id for each in ast.walk(field.annotation) if isinstance(each, ast.Name)}
        key = ast.unparse(field.target)
        for name in kinds & set(classes):
            is_list = "tuple" in kinds
            found.setdefault(name, f"[[{key}]]" if is_list else f"[{key}]")
    return found


def _fields(node: ast.ClassDef) -> list[ast.AnnAssign]:
    return [
        each
        for each in node.body
        if isinstance(each, ast.AnnAssign) and ast.unparse(each.target) != "model_config"
    ]


def _row(field: ast.AnnAssign, comments: dict[int, tuple[bool, str]]) -> str:
    default, bounds = _default(field.value)
    note = _note(field, comments)
    kind = ast.unparse(field.annotation).replace("|", "\\|")
    meaning = _cell("; ".join(each for each in (note.rstrip("."), bounds) if each))
    shown = f"`{default}`" if default else "needed"
    return f"| `{ast.unparse(field.target)}` | {meaning} | {shown} | `{kind}` |\n"


def _default(value: ast.expr | None) -> tuple[str, str]:
    """Return a field's default and its bounds in words."""
    if value is None:
        return "", ""
    if not (isinstance(value, ast.Call) and ast.unparse(value.func) == "Field"):
        return ast.unparse(value), ""
    words = {each.arg or "": ast.unparse(each.value) for each in value.keywords}
    signs = {"gt": "above", "ge": "at least", "lt": "below", "le": "at most"}
    bounds = ", ".join(f"{sign} {words[key]}" for key, sign in signs.items() if key in words)
    return words.get("default", ""), bounds


def _note(field: ast.AnnAssign, comments: dict[int, tuple[bool, str]]) -> str:
    """Return the comments above a field, and those behind it."""
    above: list[str] = []
    line = field.lineno - 1
    while line in comments and comments[line][0]:
        above.insert(0, comments[line][1])
        line -= 1
    behind = [
        comments[each][1]
        for each in range(field.lineno, (field.end_lineno or field.lineno) + 1)
        if each in comments and not comments[each][0]
    ]
    return " ".join([*above, *behind])


def _comments_in(source: str) -> dict[int, tuple[bool, str]]:
    """Return each comment by its line, and whether it has the line to itself."""
    found = {}
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type == tokenize.COMMENT:
            is_alone = not token.line[: token.start[1]].strip()
            found[token.start[0]] = (is_alone, token.string.lstrip("# "))
    return found


def _cell(text: str) -> str:
    return " ".join(text.replace("|", "\\|").replace("<", "&lt;").split())
