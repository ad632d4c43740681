"""Run the script of each library in its own environment, and write a table.

`make test-libraries` runs all, `python tests/libraries/run.py tianshou_ppo` one; the table shows
the last outcome of each. Every script says in its head which versions it needs; its environment
stands in the user's cache, above this one, so that only what differs is installed. The first line
of a script's docstring says what it tries, the last line that it prints what was done.
"""

import ast
import hashlib
import json
import subprocess
import sys
import time
import tomllib
from dataclasses import asdict, dataclass
from pathlib import Path
from site import getsitepackages

from race_server.core.kernels.jit import cache_root

FOLDER = Path(__file__).resolve().parent
PAGE = FOLDER.parents[1] / "docs" / "libraries.md"
MOST_S = 1200.0
BEGIN, END = "<!-- table: make test-libraries -->", "<!-- end of table -->"


@dataclass(frozen=True)
class Outcome:
    """Outcome of the script of one library."""

    name: str
    versions: str
    tried: str
    done: str  # empty: it failed
    seconds: float


def requirements_of(script: Path) -> list[str]:
    """Return the packages that a script names in its head."""
    lines = script.read_text(encoding="utf-8").splitlines()
    first, last = lines.index("# /// script"), lines.index("# ///")
    head = "\n".join(line.removeprefix("#").strip() for line in lines[first + 1 : last])
    found: list[str] = tomllib.loads(head)["dependencies"]
    return found


def environment_for(requirements: list[str]) -> Path:
    """Return the Python of an environment with these packages, on top of those of this one."""
    beneath = getsitepackages()[0]
    mark = hashlib.sha256(repr((requirements, beneath, sys.version)).encode()).hexdigest()[:12]
    place = cache_root() / "libraries" / mark
    python, done = place / "bin" / "python", place / "installed"
    if done.exists():
        return python
    subprocess.run([sys.executable, "-m", "venv", place], check=True)
    ask = [python, "-c", "import site; print(site.getsitepackages()[0])"]
    packages = Path(subprocess.run(ask, check=True, capture_output=True, text=True).stdout.strip())
    (packages / "beneath.pth").write_text(f"import site; site.addsitedir({beneath!r})\n")
    quiet = ["--quiet", "--disable-pip-version-check"]
    subprocess.run([python, "-m", "pip", "install", *quiet, *requirements], check=True)
    done.touch()
    return python


def outcome_of(script: Path) -> Outcome:
    """Install what a script needs, and run it."""
    requirements = requirements_of(script)
    tried = (ast.get_docstring(ast.parse(script.read_text(encoding="utf-8"))) or "").splitlines()[0]
    begun, done, why = time.monotonic(), "", ""
    try:
        python = environment_for(requirements)
        begun = time.monotonic()
        ran = subprocess.run(
            [python, script],
            cwd=python.parents[1],  # some write logs where they are
            capture_output=True,
            text=True,
            timeout=MOST_S,
            check=False,
        )
        done = ran.stdout.strip().splitlines()[-1] if ran.returncode == 0 else ""
        why = ran.stderr.strip()[-2000:]
    except (subprocess.CalledProcessError, subprocess.TimeoutExpired, IndexError) as error:
        why = str(error)
    seconds = time.monotonic() - begun
    print(f"{script.stem}: {done or 'FAILED: ' + why} ({seconds:.0f} s)", flush=True)
    return Outcome(script.stem, ", ".join(requirements).replace("==", " "), tried, done, seconds)


def table_of(names: list[str], known: dict[str, Outcome], page: str) -> str:
    """Return a table in Markdown. A script that is not known here keeps the row of the page."""
    before = {line.split("`")[-2]: line for line in page.splitlines() if line.endswith(".py` |")}
    rows = []
    for name in names:
        if one := known.get(name):
            done = one.done or "**failed**"
            rows.append(f"| {one.versions} | {one.tried} | {done} | `{one.name}.py` |")
        elif f"{name}.py" in before:
            rows.append(before[f"{name}.py"])
    head = ["| packages | what is tried | what was done | script |", "|---|---|---|---|"]
    return "\n".join([BEGIN, "", *head, *rows, "", END])


def main(names: list[str]) -> int:
    """Run the scripts of these names, or all, and write the table of all last outcomes."""
    scripts = [path for path in sorted(FOLDER.glob("*.py")) if path.name != Path(__file__).name]
    chosen = [path for path in scripts if not names or path.stem in names]
    outcomes = [outcome_of(path) for path in chosen]
    kept = cache_root() / "libraries" / "outcomes.json"
    known = json.loads(kept.read_text(encoding="utf-8")) if kept.exists() else {}
    known |= {one.name: asdict(one) for one in outcomes}
    kept.write_text(json.dumps(known, indent=1), encoding="utf-8")
    text = PAGE.read_text(encoding="utf-8")
    before, after = text.split(BEGIN)[0], text.split(END)[1]
    found = {name: Outcome(**row) for name, row in known.items()}
    table = table_of([path.stem for path in scripts], found, text)
    PAGE.write_text(before + table + after, encoding="utf-8")
    failed = [one.name for one in outcomes if not one.done]
    print(f"{len(outcomes) - len(failed)} passed, {len(failed)} failed")
    return int(bool(failed))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
