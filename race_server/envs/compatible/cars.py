"""Cars of ours under the rules of an environment of highway-env, one in each of many worlds."""

from collections.abc import Callable, Mapping
from typing import Any, ClassVar, NamedTuple, Protocol

import gymnasium
import numpy as np
from numpy.typing import NDArray

from race_server.core.clock import TICKS_PER_SECOND
from race_server.core.seeds import MOST_SEED
from race_server.envs.action_shapes import numbers
from race_server.envs.batch import Batch
from race_server.envs.compatible.config import Config
from race_server.errors import ScenarioError

Array = NDArray[Any]
Infos = dict[str, Any]  # arrays (W, ...), and dictionaries of such


class Moved(NamedTuple):
    """What a decision has come to in every world."""

    rewards: Array  # (W,)
    over: Array  # (W,) whether the episode has ended
    cut: Array  # (W,) whether its time is up
    infos: Infos


class Cars(Protocol):
    """One environment of highway-env, W times; what it returns may be overwritten by its calls."""

    defaults: ClassVar[Mapping[str, Any]]  # of the configuration
    config: Config
    batch: Batch
    observation_space: gymnasium.Space[Any]  # of one
    action_space: gymnasium.Space[Any]  # of one

    def __init__(self, changes: Mapping[str, Any], worlds: int) -> None:
        """Build the worlds. changes: of the configuration.

        Raises:
            ScenarioError: the configuration is not valid.
        """

    def begin(self, w: int, seed: int | None, chance: np.random.Generator) -> None:
        """Begin an episode of one world; with a seed the same one again.

        chance: draws what the seed leaves open, and the seed of a world that gets and had none.
        """

    def observe(self) -> Any:
        """Return what is seen, with a leading axis W."""

    def move(self, actions: Array) -> Moved:
        """Move every world on by a decision. actions: (W, A)."""

    def infos(self, actions: Array) -> Infos:
        """Return what is told of every world as it is."""


def begin_round(batch: Batch, w: int, seed: int | None, chance: np.random.Generator) -> None:
    """Begin a new round of one world; with a seed the same one again.

    chance: draws the seed of a world that gets and had none.
    """
    if seed is None and not batch.is_sown[w]:
        seed = int(chance.integers(MOST_SEED))
    batch.reset([seed], worlds=[w])


def decisions_of(config: Config) -> float:
    """Return how many decisions an episode lasts."""
    ticks = TICKS_PER_SECOND // config["policy_frequency"]
    return float(config["duration"] * TICKS_PER_SECOND / ticks)


def numbers_of(actions: Any, shape: tuple[int, ...] | None) -> Array:
    """Return actions as numbers of a shape.

    Raises:
        ScenarioError: they have another one, or are no numbers.
    """
    given = numbers(actions, np.float64)
    if given.shape != shape:
        raise ScenarioError(f"actions of shape {given.shape}: give {shape}")
    return given


def each(values: Any, change: Callable[[Array], Any]) -> Any:
    """Return observations or infos with each array changed, however deep it lies."""
    if isinstance(values, dict):
        return {
            name: each(value, change) if isinstance(value, dict) else change(value)
            for name, value in values.items()
        }
    return change(values)
