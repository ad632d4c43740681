"""Where files of courses and car parks are: in own folders, and beside the program."""

import os
from pathlib import Path

from race_server.errors import ScenarioError


def own_folder(kind: str) -> Path:
    """Return the folder that comes with the program. kind: tracks or lots."""
    package = Path(__file__).parents[1] / kind
    return package if package.is_dir() else Path(__file__).parents[2] / kind


def folders_of(kind: str) -> list[Path]:
    """Return all folders: those in $RACE_TRACKS or $RACE_LOTS first, then the program's.

    Raises:
        ScenarioError: one of them does not exist.
    """
    variable = f"RACE_{kind.upper()}"
    chosen = [Path(name) for name in os.environ.get(variable, "").split(os.pathsep) if name]
    for folder in chosen:
        if not folder.is_dir():
            raise ScenarioError(f"{variable}: {folder} is no folder; make it, or name another one")
    return [*chosen, own_folder(kind)]


def names_of(kind: str) -> list[str]:
    """Return the names of all files that can be found."""
    return sorted(
        {
            path.stem
            for folder in folders_of(kind)
            for path in folder.glob("*.toml")
            if _is_file(path)
        }
    )


def path_of(kind: str, name: str) -> Path | None:
    """Return the file of a name, or of a path that ends in ``.toml``; None if there is none."""
    if name.endswith(".toml"):
        return Path(name)
    paths = (folder / f"{name}.toml" for folder in folders_of(kind))
    return next((path for path in paths if _is_file(path)), None)


def _is_file(path: Path) -> bool:
    """Return whether a path is a file that can be seen; one with too long a name is none."""
    try:
        return path.is_file()
    except OSError:
        return False
