"""Small games for teams, as vector environments in which some leave early."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray
from stable_baselines3.common.vec_env import VecEnv

Array = NDArray[Any]


class Turn(NamedTuple):
    """What one decision of all teams leads to; W teams of L players."""

    rewards: Array  # (W, L)
    leaves: Array  # (W, L) players whose part is over
    seen: Array  # (W, L, S)


# Takes the number of the decision in each round (W,), actions (W, L), which are active (W, L), and
# what the game has noted (W,), which it may change.
Play = Callable[[Array, Array, Array, Array], Turn]


class TeamGame(VecEnv):
    """Rounds of a game side by side; the next one begins once all players of a team have left."""

    def __init__(self, teams: int, first: Array, play: Play) -> None:
        """first: (L, S) what the players of a team see at the start of a round."""
        self._first, self._play = np.float32(first), play
        shape = (teams, len(first))
        super().__init__(
            teams * len(first), spaces.Box(-10.0, 10.0, (first.shape[1],)), spaces.Discrete(2)
        )
        self._driving = np.ones(shape, np.bool_)
        self._turn, self._notes = np.zeros(teams, np.int64), np.zeros(teams)
        self._actions = np.zeros(shape, np.int64)

    @property
    def active(self) -> Array:
        return self._driving.ravel().copy()

    def reset(self) -> Array:
        self._driving[:] = True
        self._turn[:], self._notes[:] = 0, 0.0
        return self._flat(
            np.broadcast_to(self._first, (*self._driving.shape, self._first.shape[1]))
        )

    def step_async(self, actions: Array) -> None:
        self._actions = np.reshape(actions, self._driving.shape)

    def step_wait(self) -> Any:
        turn = self._play(self._turn, self._actions, self._driving, self._notes)
        done = self._driving & turn.leaves
        self._driving &= ~done
        self._turn += 1
        over = ~self._driving.any(axis=1)
        self._driving[over], self._turn[over], self._notes[over] = True, 0, 0.0
        seen = np.where(over[:, None, None], self._first, turn.seen)
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for number in np.flatnonzero(done):
            infos[number] = {"terminal_observation": self._flat(turn.seen)[number]}
        return self._flat(seen), np.float32(turn.rewards).ravel(), done.ravel(), infos

    def _flat(self, seen: Array) -> Array:
        return np.array(seen, np.float32).reshape(self.num_envs, -1)

    def close(self) -> None:
        """Nothing is open."""

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        return [getattr(self, attr_name)] * self.num_envs

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        setattr(self, attr_name, value)

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any) -> Any:
        return [getattr(self, method_name)(*args, **kwargs)] * self.num_envs

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        return [False] * self.num_envs

    @property
    def render_mode(self) -> None:
        return None

    @render_mode.setter
    def render_mode(self, value: Any) -> None:
        pass


def only_the_first_matters(teams: int) -> TeamGame:
    """One decision; both players get 1 if the first picks 1, whatever the second picks."""
    first = np.array([[1.0, 0.0], [0.0, 1.0]])

    def play(turn: Array, actions: Array, active: Array, notes: Array) -> Turn:
        paid = np.repeat(actions[:, :1] == 1, 2, axis=1)
        return Turn(paid, np.ones_like(active), np.zeros((teams, 2, 2)))

    return TeamGame(teams, first, play)


def a_door(teams: int) -> TeamGame:
    """Two decisions. The first player may leave at the first one, for -0.4, and so open a door.

    At the second decision the other one gets 1 if it picks 1 and the door is open. To leave costs
    the team 0.2 and gains 0.5, after the one that left has gone.
    """
    first = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    after = np.array([[1.0, 0.0, 1.0], [0.0, 1.0, 1.0]])

    def play(turn: Array, actions: Array, active: Array, notes: Array) -> Turn:
        is_last = turn == 1
        opens = ~is_last & (actions[:, 0] == 1)
        goes = is_last & (actions[:, 1] == 1) & (notes == 1.0)
        notes[opens] = 1.0
        rewards = np.stack([np.where(opens, -0.4, 0.0), np.where(goes, 1.0, 0.0)], axis=1)
        leaves = np.stack([opens | is_last, is_last], axis=1)
        return Turn(rewards, leaves, np.broadcast_to(after, (teams, 2, 3)))

    return TeamGame(teams, first, play)


def alone(players: int) -> TeamGame:
    """Three decisions of one player, which gets what it picks, and sees which decision it is."""

    def play(turn: Array, actions: Array, active: Array, notes: Array) -> Turn:
        seen = np.stack([turn + 1.0, np.ones_like(turn)], axis=1)[:, None]
        return Turn(actions.astype(float), np.repeat(turn[:, None] == 2, 1, axis=1), seen)

    return TeamGame(players, np.array([[0.0, 1.0]]), play)
