"""What a turn of a black box has to hold: a file may come from any program."""

from collections.abc import Callable
from typing import Any

from race_server.scenario.toml_reader import is_number

Turn = dict[str, Any]


def fault_in(turn: Any) -> str:
    """Return what is wrong with a turn, to follow its name; empty where nothing is.

    Looked at is what `race black-box` shows; other readers find the rest as it was written.
    """
    if not isinstance(turn, dict):
        return "holds no named values"
    for name, is_sound in _NEEDED.items():
        if name not in turn:
            return f"has no {name}"
        if not is_sound(turn[name]):
            return f"has an unknown kind of {name}"
    for name, is_sound in _POSSIBLE.items():
        if name in turn and not is_sound(turn[name]):
            return f"has an unknown kind of {name}"
    return ""


def _is_known_or_not(value: Any) -> bool:
    return value is None or is_number(value)


def _are_numbers(value: Any, least: int) -> bool:
    """Return whether a value is a list of `least` numbers or more; some may not be known."""
    return isinstance(value, list) and len(value) >= least and all(map(_is_known_or_not, value))


def _are_names(value: Any) -> bool:
    return isinstance(value, list) and all(isinstance(name, str) for name in value)


def _is_alert(value: Any) -> bool:
    return (
        isinstance(value, dict)
        and _are_names([value.get("stage"), value.get("kind")])
        and "distance" in value
        and _is_known_or_not(value["distance"])
    )


_NEEDED: dict[str, Callable[[Any], bool]] = {
    "time_s": is_number,
    "command": lambda value: _are_numbers(value, 3) and len(value) == 3,
    "cause": _are_names,
    "alert": _is_alert,
}
_POSSIBLE: dict[str, Callable[[Any], bool]] = {
    "state": lambda value: _are_numbers(value, 4),
    "deviation": is_number,
}
