"""What a race has in common, here or on a server, where its karts are agents of PettingZoo."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray
from pettingzoo import ParallelEnv

from race_server.envs.actions import DISCRETE, WIDTHS, action_kind
from race_server.envs.spaces import ROLL, action_space
from race_server.errors import ScenarioError

Vector = NDArray[np.float32]


class KartAgents(ParallelEnv[str, Vector, Any]):
    """Agents `kart_0`, `kart_1` and so on, with their spaces; `observation_spaces` is to come."""

    def __init__(self, karts: int, action: str) -> None:
        """Name the agents.

        Raises:
            ScenarioError: there is no such kind of action.
        """
        self.possible_agents = [f"kart_{k}" for k in range(karts)]
        self.agents: list[str] = []
        self.action_spaces: dict[str, spaces.Space[Any]] = {
            agent: action_space(action) for agent in self.possible_agents
        }
        kind = action_kind(action)
        still = ROLL if kind == DISCRETE else 0
        self._rest = np.full(WIDTHS[kind], still, np.float32)  # of an agent without an action

    def observation_space(self, agent: str) -> spaces.Space[Any]:
        """Return what `agent` may see: always the same object."""
        space: spaces.Space[Any] = self.observation_spaces[agent]
        return space

    def action_space(self, agent: str) -> spaces.Space[Any]:
        """Return what `agent` may do: always the same object."""
        return self.action_spaces[agent]

    def check_actions(self, actions: Mapping[str, Any]) -> None:
        """Check that actions are given by the names of agents.

        Raises:
            ScenarioError: they are not, or one is of no agent.
        """
        if not isinstance(actions, Mapping):
            raise ScenarioError(f"actions {actions!r:.60}: give a dictionary, an action by agent")
        if strangers := sorted(actions.keys() - self.action_spaces.keys(), key=str):
            raise ScenarioError(
                f"action of {strangers[0]!r}: choose of {', '.join(self.possible_agents)}"
            )
