"""The reference of the Python API and of its errors, from what the packages export."""

import inspect
from types import ModuleType


def api_page(*packages: ModuleType) -> str:
    """Return the page of all public names; autodoc fills it in."""
    parts = [
        "# Python API\n",
        "The names that programs may import. All other modules may move from one version to the "
        "next.\n",
    ]
    for package in packages:
        parts += [
            f"## {package.__name__}\n",
            f"{_first_line(package)}\n",
        ]
        for name in package.__all__:
            value = getattr(package, name)
            if inspect.isclass(value) and issubclass(value, Exception):
                continue  # on the page of errors
            parts += [f"### {name}\n", _directive(f"{package.__name__}.{name}", value)]
    return "\n".join(parts)


def errors_page() -> str:
    """Return the page of all errors, as a tree."""
    from race_server import errors

    found = [
        value
        for value in vars(errors).values()
        if inspect.isclass(value) and issubclass(value, errors.RaceError)
    ]
    parts = [
        "# Errors\n",
        "Every error that this project raises on purpose is a `race_server.RaceError`. Its message "
        "names the thing, the value and the way out. `race` prints it on stderr and ends with 2.\n",
        "| error | raised when | kind of |\n|---|---|---|",
        "".join(
            f"| {{py:exc}}`~race_server.{each.__name__}` | {_first_line(each)} "
            f"| `{each.__mro__[1].__name__}` |\n"
            for each in found
        ),
    ]
    for each in found:
        parts += [f"## {each.__name__}\n", _directive(f"race_server.{each.__name__}", each)]
    return "\n".join(parts)


def _first_line(value: object) -> str:
    return (inspect.getdoc(value) or "").partition("\n")[0]


def _directive(path: str, value: object) -> str:
    if inspect.isclass(value):
        sort = "autoexception" if issubclass(value, Exception) else "autoclass"
        options = "   :members:\n   :show-inheritance:\n"
        if sort == "autoexception":
            options = "   :show-inheritance:\n"
    elif callable(value):
        sort, options = "autofunction", ""
    else:
        sort, options = "autodata", ""
    return f"```{{eval-rst}}\n.. {sort}:: {path}\n{options}```\n"
