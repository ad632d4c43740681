"""Find reproductions by name: one file each."""

import importlib
import pkgutil

from race_agents.reproductions import reports
from race_agents.reproductions.plan import Reproduction
from race_server.errors import ScenarioError


def reproduction_names() -> list[str]:
    """Return the names of all reproductions."""
    return sorted(found.name.replace("_", "-") for found in pkgutil.iter_modules(reports.__path__))


def reproduction_named(name: str) -> Reproduction:
    """Return a reproduction by name.

    Raises:
        ScenarioError: there is none of that name.
    """
    known = reproduction_names()
    if name not in known:
        raise ScenarioError(f"reproduction {name!r} is unknown; choose one of {', '.join(known)}")
    module = importlib.import_module(f"{reports.__name__}.{name.replace('-', '_')}")
    found: Reproduction = module.REPRODUCTION
    return found
