"""Configurations as highway-env's environments take them: changes of what is given by default."""

from collections.abc import Collection, Mapping
from typing import Any

import numpy as np

from race_server.core.bounds import MOST_ROUND_S
from race_server.core.clock import TICKS_PER_SECOND
from race_server.errors import ScenarioError

Config = dict[str, Any]

# Of pictures, and of physics: motion here is that of our world, in its own steps.
WITHOUT_EFFECT = {
    "simulation_frequency": 15,
    "screen_width": 600,
    "screen_height": 600,
    "centering_position": [0.5, 0.5],
    "scaling": 5.5,
    "show_trajectories": False,
    "render_agent": True,
    "offscreen_rendering": None,
    "real_time_rendering": False,
}


def config_of(
    name: str, defaults: Mapping[str, Any], changes: Mapping[str, Any], fixed: Collection[str]
) -> Config:
    """Return a configuration. fixed: keys whose values are known, and may not be changed.

    Raises:
        ScenarioError: there is no such key, or its value cannot be had here.
    """
    config = {**WITHOUT_EFFECT, **defaults}
    for key, value in changes.items():
        if key not in config:
            known = ", ".join(sorted(set(defaults) - set(fixed)))
            raise ScenarioError(f"{name}: config {key!r} is unknown; choose from {known}")
        if key in fixed and value != config[key]:
            raise ScenarioError(
                f"{name}: config {key!r} is {value!r}; here it stays {config[key]!r}"
            )
        if key not in fixed and key in defaults and not _fits(value, defaults[key]):
            raise ScenarioError(
                f"{name}: config {key!r} is {value!r}; give one like {defaults[key]!r}"
            )
        config[key] = int(value) if type(defaults.get(key)) is int else value
    _check_times(name, config)
    return config


def _fits(value: Any, default: Any) -> bool:
    """Return whether a value is of the kind of a default: as many finite numbers, or yes or no."""
    if isinstance(default, bool):
        return isinstance(value, bool)
    if isinstance(value, bool):
        return False
    try:
        numbers = np.asarray(value, np.float64)
    except (TypeError, ValueError):
        return False
    is_whole = isinstance(default, float | list) or float(numbers) == int(numbers)
    return numbers.shape == np.shape(default) and bool(np.isfinite(numbers).all()) and is_whole


def _check_times(name: str, config: Config) -> None:
    frequency = config["policy_frequency"]
    if not 1 <= frequency <= TICKS_PER_SECOND or TICKS_PER_SECOND % frequency:
        raise ScenarioError(
            f"{name}: config 'policy_frequency' is {frequency!r}; give one that "
            f"{TICKS_PER_SECOND} ticks a second are a multiple of"
        )
    longest = MOST_ROUND_S - 1.0
    if not 0 < config["duration"] <= longest:
        raise ScenarioError(
            f"{name}: config 'duration' is {config['duration']!r}; give seconds above 0, up to "
            f"{longest:g}"
        )
