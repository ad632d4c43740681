"""The training world as a PettingZoo parallel environment: one race, an agent for each kart.

Shapes: an observation is (size,) in SI units, see `docs/observations.md`.
"""

from typing import Any, ClassVar

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray
from pettingzoo.utils.conversions import parallel_to_aec
from pettingzoo.utils.env import AECEnv

from race_server.envs.batch import Batch
from race_server.envs.buffers import STAY
from race_server.envs.camera import RENDER_MODES, Camera
from race_server.envs.kart_agents import KartAgents, Vector
from race_server.envs.presets import parking_task, race_task
from race_server.envs.spaces import observation_space
from race_server.envs.task import Task


class KartRace(KartAgents):
    """One race. A kart that finishes or retires leaves `agents`."""

    metadata: ClassVar[dict[str, Any]] = {
        "name": "kart_race_v0",
        "render_modes": list(RENDER_MODES),
        "is_parallelizable": True,
        "render_fps": 20,
    }

    def __init__(
        self, task: Task | None = None, *, max_cycles: int = 0, render_mode: str | None = None
    ) -> None:
        """Build the race of `task`; by default eight karts with radar on a shipped track.

        max_cycles: decisions until karts that still race are cut off; 0 leaves that to the task.

        Raises:
            ScenarioError, DriverError: the task makes no race.
        """
        self.max_cycles = max_cycles
        self.render_mode = render_mode
        self.batch = Batch(task or race_task(), after=STAY)
        super().__init__(self.batch.learners, self.batch.task.action)
        self._numbers = {agent: k for k, agent in enumerate(self.possible_agents)}
        self.observation_spaces: dict[str, spaces.Space[Any]] = {
            agent: observation_space(self.batch.layout) for agent in self.possible_agents
        }
        self._steps = 0
        self._camera = Camera(self.batch, render_mode)

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Vector], dict[str, dict[str, Any]]]:
        """Begin a new race; with a seed the same one again. Options are not used."""
        self.batch.reset(seed)
        self._steps = 0
        idle = self.batch.buffers.idle[0]
        self.agents = [agent for agent, k in self._numbers.items() if not idle[k]]
        seen = self.batch.observations[0].copy()
        infos = {
            agent: {"reality_gap": self.batch.draws(0, self._numbers[agent])}
            for agent in self.agents
        }
        return {agent: seen[self._numbers[agent]] for agent in self.agents}, infos

    def step(
        self, actions: dict[str, Any]
    ) -> tuple[
        dict[str, Vector],
        dict[str, float],
        dict[str, bool],
        dict[str, bool],
        dict[str, dict[str, Any]],
    ]:
        """Move the race on by one decision.

        An agent without an action rolls on with its pedals and wheel at rest.
        """
        batch, agents = self.batch, self.agents
        numbers = [self._numbers[agent] for agent in agents]
        given = batch.buffers.actions[0]
        given[:] = 0.0
        for agent, k in zip(agents, numbers, strict=True):
            if agent in actions:
                given[k] = actions[agent]
        batch.step()
        self._steps += 1
        late = 0 < self.max_cycles <= self._steps
        seen, terms = batch.observations[0].copy(), batch.buffers.terms[0].tolist()
        rewards, ended = batch.rewards[0].tolist(), batch.terminated[0].tolist()
        cut = batch.truncated[0].tolist()
        observations = {}
        gained = {}
        terminations = {}
        truncations = {}
        infos: dict[str, dict[str, Any]] = {}
        left = []
        for agent, k in zip(agents, numbers, strict=True):
            observations[agent] = seen[k]
            gained[agent] = rewards[k]
            terminations[agent] = is_over = bool(ended[k])
            truncations[agent] = is_cut = not is_over and (late or bool(cut[k]))
            infos[agent] = {"reward_terms": dict(zip(batch.terms, terms[k], strict=True))}
            if is_over or is_cut:
                infos[agent]["episode"] = batch.episode_of(0, k)
            else:
                left.append(agent)
        self.agents = left
        return observations, gained, terminations, truncations, infos

    def render(self) -> NDArray[np.uint8] | None:
        """Return the race as (height, width, 3) bytes (`rgb_array`), or show it in a window."""
        return self._camera.shoot()

    def close(self) -> None:
        """Close the window."""
        self._camera.close()
        self.batch.close()

    def state(self) -> Vector:
        """Return the observations of all learning karts, one behind the other, (L · size,)."""
        return self.batch.observations[0].ravel().copy()


def parallel_env(**options: Any) -> KartRace:
    """Return a race as a PettingZoo parallel environment; options as for `KartRace`."""
    return KartRace(**options)


def env(**options: Any) -> AECEnv[str, Vector, Any]:
    """Return a race as a PettingZoo environment in which agents take turns."""
    return parallel_to_aec(parallel_env(**options))


def parallel_lot(
    lot: str = "yard-70", vehicles: int = 4, max_cycles: int = 0, **options: Any
) -> KartRace:
    """Return vehicles that park, each in its slot; options as for `parking_task`.

    With `team=True` each gets the mean of all rewards, and leaves `agents` with the last of them.
    """
    render_mode = options.pop("render_mode", None)
    task = parking_task(lot, vehicles=vehicles, **options)
    return KartRace(task, max_cycles=max_cycles, render_mode=render_mode)


def lot(**options: Any) -> AECEnv[str, Vector, Any]:
    """Return the same as a PettingZoo environment in which agents take turns."""
    return parallel_to_aec(parallel_lot(**options))
