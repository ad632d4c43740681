"""highway-env, where it is installed (https://github.com/Farama-Foundation/HighwayEnv)."""

import warnings
from typing import Any

from race_server.errors import ScenarioError

INSTALL = "`pip install race-server[bench]` brings it"


def has_highway() -> bool:
    """Return whether highway-env is installed, and register its environments if it is."""
    try:
        import highway_env  # noqa: F401  # registers its environments
    except ImportError:
        return False
    return True


def make_highway(name: str, **config: Any) -> Any:
    """Return an environment of highway-env by its name, with changes of its configuration.

    Raises:
        ScenarioError: highway-env is not installed, or has no such environment.
    """
    if not has_highway():
        raise ScenarioError(f"highway-env is not installed: {INSTALL}")
    import gymnasium

    spec = gymnasium.registry.get(name)
    if spec is None or not str(spec.entry_point).startswith("highway_env."):
        raise ScenarioError(f"highway-env has no environment {name!r}")
    with warnings.catch_warnings():
        # That there is a v1 by now is no news: it only names its lanes otherwise.
        warnings.simplefilter("ignore", DeprecationWarning)
        return gymnasium.make(name, disable_env_checker=True, config=config)
