"""What an environment takes as actions: numbers, and as many as the learning karts need."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from race_server.core.state import Float32s
from race_server.envs.actions import DISCRETE, WIDTHS, discrete_table
from race_server.errors import ScenarioError

DISCRETE_ACTIONS = frozenset(range(len(discrete_table())))


def actions_as(actions: Any, shape: tuple[int, int, int]) -> Float32s:
    """Return actions of all learning karts in the shape (W, L, A).

    They may come as (W, L, A) or (W · L, A); for one kart as (A,); the last axis may be missing
    where an action is one number.

    Raises:
        ScenarioError: they have another shape, or one of them is none, see `finite`.
    """
    worlds, learners, width = shape
    karts = worlds * learners
    given = numbers(actions)
    fitting = [shape, (karts, width)]
    if karts == 1:
        fitting.append((width,))
    if width == 1:
        fitting += [(worlds, learners), (karts,)]
    if karts == width == 1:
        fitting.append(())
    if given.shape not in fitting:
        raise ScenarioError(
            f"actions of shape {given.shape}: give {shape} (worlds, learning karts, numbers of an "
            f"action) or {(karts, width)}"
        )
    return finite(given.reshape(shape))


def action_as(action: Any, width: int, agent: str = "") -> Float32s:
    """Return the action of one kart in the shape (A,). agent: its name, for the error.

    Raises:
        ScenarioError: it has another shape, or one of its numbers is none, see `finite`.
    """
    given = numbers(action)
    if given.shape != (width,) and not (width == 1 and given.shape == ()):
        raise ScenarioError(f"action{_of(agent)} of shape {given.shape}: give {(width,)}")
    return finite(given.reshape(width), agent)


def finite(actions: Float32s, agent: str = "") -> Float32s:
    """Return actions as they are.

    Raises:
        ScenarioError: one of them is not a finite number, or, where an action is one number, not
            the number of a discrete action.
    """
    flat = actions.ravel()
    # The sum of squares is finite, or one of them is not (or very large): faster than `isfinite`.
    with np.errstate(over="ignore"):
        squares = flat.dot(flat)
    if not math.isfinite(squares) and not np.isfinite(flat).all():
        where = [int(place) for place in np.argwhere(~np.isfinite(actions))[0]]
        value = float(actions[tuple(where)])
        raise ScenarioError(
            f"action{_of(agent)}: {value} at {where}: give finite numbers; a network that answers "
            "so has diverged"
        )
    if actions.shape[-1] == WIDTHS[DISCRETE] and not DISCRETE_ACTIONS.issuperset(flat.tolist()):
        where = [int(place) for place in np.argwhere(~np.isin(actions, [*DISCRETE_ACTIONS]))[0]]
        raise ScenarioError(
            f"action{_of(agent)}: {float(actions[tuple(where)]):g} at {where}: give a whole number "
            f"from 0 to {max(DISCRETE_ACTIONS)}"
        )
    return actions


def _of(agent: str) -> str:
    return f" of {agent}" if agent else ""


def numbers(actions: Any, kind: type[np.floating[Any]] = np.float32) -> NDArray[Any]:
    """Return actions as an array of floats of a kind; what is too large for it is infinite.

    Raises:
        ScenarioError: they are no numbers.
    """
    try:
        given = np.asarray(actions)
        with np.errstate(over="ignore"):
            converted = given.astype(kind, copy=False) if given.dtype.kind not in "cSU" else None
    except (TypeError, ValueError):
        converted = None
    if converted is None:  # complex numbers or text, which numpy would convert, or no array
        raise ScenarioError(f"action {actions!r}: give numbers")
    return converted
