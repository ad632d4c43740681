"""Numbers that a caller gives in Python: whole, finite and within bounds, or one clear error."""

import math
from numbers import Integral, Real
from typing import Any

import numpy as np

from race_server.errors import ScenarioError


def check_whole(name: str, value: Any, least: int, most: int | None = None) -> None:
    """Check that a setting is a whole number within bounds; without `most` there is no upper one.

    Raises:
        ScenarioError: it is none.
    """
    is_whole = isinstance(value, Integral) and not isinstance(value, bool)
    number = int(value) if is_whole else least - 1
    if least <= number and (most is None or number <= most):
        return
    bounds = f"{least} at least" if most is None else f"{least} to {most}"
    raise ScenarioError(f"{name} = {value!r}: choose a whole number, {bounds}")


def check_number(
    name: str, value: Any, least: float = -math.inf, most: float = math.inf, way_out: str = ""
) -> None:
    """Check that a setting is a finite number within bounds. way_out: added to the advice.

    Raises:
        ScenarioError: it is none.
    """
    number = float(value) if isinstance(value, Real) else math.nan
    if math.isfinite(number) and least <= number <= most:
        return
    given = f"{number:g}" if isinstance(value, Real) else repr(value)
    if math.isfinite(least) and math.isfinite(most):
        advice = f"choose {least:g} to {most:g}"
    else:
        advice = f"choose a number, {least:g} at least" if least > -math.inf else "give a number"
    raise ScenarioError(f"{name} = {given}: {advice}{way_out}")


def check_flag(name: str, value: Any) -> None:
    """Check that a setting is true or false.

    Raises:
        ScenarioError: it is neither.
    """
    if not isinstance(value, bool | np.bool_):
        raise ScenarioError(f"{name} = {value!r}: choose True or False")
