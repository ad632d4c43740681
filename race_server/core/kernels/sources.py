"""Which files the compiled kernels are made of.

Machine code is out of date as soon as one of them changes. They follow the packages, not a list of
folders: all of `core` and `envs`, and of every installed package that offers a driver or other
kernels the modules that these import from it.
"""

import ast
from collections.abc import Iterator
from importlib.metadata import entry_points
from importlib.util import find_spec
from pathlib import Path

PACKAGE = Path(__file__).parents[2]
WINGS = ("core", "envs")
# Entry points of drivers, and of modules with kernels that no driver calls.
GROUPS = ("race_server.drivers", "race_server.kernels")
# Where a statement holds others.
_BLOCKS = ("body", "orelse", "finalbody", "handlers", "cases")


def kernel_sources() -> dict[str, Path]:
    """Return the files that hold kernels, and those that kernels take constants from, by module."""
    sources = {}
    for wing in WINGS:
        for path in sorted((PACKAGE / wing).rglob("*.py")):
            sources[_module_of(path, PACKAGE)] = path
    return sources | brought_sources()


def brought_sources() -> dict[str, Path]:
    """Return the modules behind those entry points, and what they import of their package.

    An import inside a function counts as well; one of a package that offers none does not.
    """
    starts = {point.module for group in GROUPS for point in entry_points(group=group)}
    roots = {start.split(".")[0]: _root_of(start.split(".")[0]) for start in starts}
    found: dict[str, Path] = {}
    waiting = sorted(starts)
    while waiting:
        module = waiting.pop()
        root = roots.get(module.split(".")[0])
        path = _file_of(module, root) if root else None
        if path is None or module in found:
            continue
        found[module] = path
        waiting += _imports_of(path, module)
    return dict(sorted(found.items()))


def _root_of(name: str) -> Path | None:
    """Return the folder of an installed package, or the file of one that is a single module."""
    spec = find_spec(name)
    if spec is None:
        return None
    for folder in spec.submodule_search_locations or ():
        return Path(folder)
    return Path(spec.origin) if spec.origin else None


def _file_of(module: str, root: Path) -> Path | None:
    place = root.joinpath(*module.split(".")[1:])
    for path in (place, place.with_suffix(".py"), place / "__init__.py"):
        if path.is_file():
            return path
    return None


def _imports_of(path: Path, module: str) -> list[str]:
    """Return all names that a file imports, each as if it were a module."""
    try:
        tree = ast.parse(path.read_bytes())
    except (SyntaxError, ValueError):
        return []  # it cannot be imported either, and its driver reports that
    package = module if path.name == "__init__.py" else module.rpartition(".")[0]
    names = []
    for node in _statements_in(tree):
        if isinstance(node, ast.Import):
            names += [each.name for each in node.names]
        elif isinstance(node, ast.ImportFrom):
            above = package.split(".")[: len(package.split(".")) - max(node.level - 1, 0)]
            base = ".".join(
                [*(above if node.level else ()), *([node.module] if node.module else ())]
            )
            names += [base, *(f"{base}.{each.name}" for each in node.names)]
    return names


def _statements_in(tree: ast.AST) -> Iterator[ast.AST]:
    """Yield all statements; an import is one, and what is inside an expression takes long."""
    waiting = [tree]
    while waiting:
        node = waiting.pop()
        yield node
        for name in _BLOCKS:
            waiting += getattr(node, name, ())


def _module_of(path: Path, package: Path) -> str:
    return ".".join(path.relative_to(package.parent).with_suffix("").parts)
