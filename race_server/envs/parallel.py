"""The training world as a PettingZoo parallel environment: one race, an agent for each kart.

Shapes: an observation is (size,) in SI units, see `docs/observations.md`.
"""

import struct
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray
from pettingzoo.utils.conversions import parallel_to_aec
from pettingzoo.utils.env import AECEnv

from race_server.envs.action_shapes import action_as
from race_server.envs.batch import Batch
from race_server.envs.buffers import STAY
from race_server.envs.camera import RENDER_MODES, Camera
from race_server.envs.global_state import global_states, state_space
from race_server.envs.kart_agents import KartAgents, Vector
from race_server.envs.presets import parking_task, race_task
from race_server.envs.saved_state import own_part_in
from race_server.envs.spaces import masks_for, observation_space
from race_server.envs.task import Task
from race_server.errors import ScenarioError
from race_server.scenario.checked import check_whole

_STEPS = struct.Struct("<Q")


class KartRace(KartAgents):
    """One race. A kart that finishes or retires leaves `agents`."""

    metadata: dict[str, Any] = {  # noqa: RUF012  # as PettingZoo declares it
        "name": "kart_race_v0",
        "render_modes": list(RENDER_MODES),
        "is_parallelizable": True,
        "render_fps": 20,  # of the default task
    }

    def __init__(
        self, task: Task | None = None, *, max_cycles: int = 0, render_mode: str | None = None
    ) -> None:
        """Build the race of `task`; by default eight karts with radar on a shipped track.

        max_cycles: decisions until karts that still race are cut off; 0 leaves that to the task.

        Raises:
            ScenarioError, DriverError: the task makes no race.
        """
        check_whole("max_cycles", max_cycles, 0)
        self.max_cycles = max_cycles
        self.render_mode = render_mode
        self.batch = Batch(task or race_task(), seed=None, after=STAY)
        task = self.batch.task
        super().__init__(self.batch.learners, task.action)
        self.metadata = {**self.metadata, "render_fps": task.decisions_per_s}
        self._numbers = {agent: k for k, agent in enumerate(self.possible_agents)}
        self.observation_spaces: dict[str, spaces.Space[Any]] = {
            agent: observation_space(self.batch.layout) for agent in self.possible_agents
        }
        self.state_space = state_space(self.batch.world)
        self._is_discrete = isinstance(self.action_space("kart_0"), spaces.Discrete)
        self._steps = 0
        self._draws: list[Any] = []  # (G,) of each kart
        self._seated: list[str] = []  # agents whose karts are `_seats`
        self._seats: list[int] = []
        self._camera = Camera(self.batch, render_mode)

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Vector], dict[str, dict[str, Any]]]:
        """Begin a new race; with a seed the same one again. options: as for `Batch.reset`.

        Raises:
            ScenarioError: the task has not what the options ask for.
        """
        self.batch.reset(seed, options)
        self._camera.follow()
        return self._begin(own_part_in(options))

    def _begin(self, own: bytes) -> tuple[dict[str, Vector], dict[str, dict[str, Any]]]:
        """Let all karts in an episode be agents, and return what they see.

        own: what `save_state` added, where the race goes on from a saved state.
        """
        self._steps = 0
        idle = self.batch.buffers.idle[0].tolist()
        self.agents = [agent for agent, k in self._numbers.items() if not idle[k]]
        self._draws = list(self.batch.buffers.draws[0].copy())
        if len(own) == _STEPS.size + len(self.possible_agents):
            (self._steps,) = _STEPS.unpack_from(own)
            present = zip(self.possible_agents, own[_STEPS.size :], strict=True)
            self.agents = [agent for agent, is_here in present if is_here]
        numbers = [self._numbers[agent] for agent in self.agents]
        seen = self.batch.observations[0].copy()
        nothing = np.zeros(len(self.batch.terms))
        infos: dict[str, dict[str, Any]] = {
            agent: {"reward_terms": nothing.copy(), "reality_gap": self._draws[k]}
            for agent, k in zip(self.agents, numbers, strict=True)
        }
        self._mask(infos)
        return dict(zip(self.agents, seen[numbers], strict=True)), infos

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

        An agent without an action has its pedals and wheel at rest, and rolls on; told its speed,
        as with `dock`, it drives at the least there is. `infos` of each agent are arrays:
        `reward_terms` (T,), in the order of `batch.terms`, and `reality_gap` (G,).

        Raises:
            ScenarioError: an action has another shape, is no number, or is of no agent.
        """
        batch, agents = self.batch, self.agents
        numbers = self._seats_of(agents)
        self._take(actions, numbers)
        batch.step()
        self._camera.follow()
        self._steps += 1
        late = 0 < self.max_cycles <= self._steps
        buffers = batch.buffers
        seen, terms = list(buffers.observations[0].copy()), list(buffers.terms[0].copy())
        rewards, draws = buffers.rewards[0].tolist(), self._draws
        ended, cut = buffers.terminated[0].tolist(), buffers.truncated[0].tolist()
        if len(numbers) < len(seen):
            seen, terms, rewards, draws = (
                [rows[k] for k in numbers] for rows in (seen, terms, rewards, draws)
            )
        observations, gained = dict(zip(agents, seen, strict=True)), dict(zip(agents, rewards))  # noqa: B905
        infos: dict[str, dict[str, Any]] = {
            agent: {"reward_terms": row, "reality_gap": drawn}
            for agent, row, drawn in zip(agents, terms, draws)  # noqa: B905
        }
        if self._is_discrete:
            self._mask(infos)
        terminations, truncations = dict.fromkeys(agents, False), dict.fromkeys(agents, late)
        if late or 1 in ended or 1 in cut:
            for agent, k in zip(agents, numbers, strict=True):
                terminations[agent] = is_over = bool(ended[k])
                truncations[agent] = not is_over and (late or bool(cut[k]))
                if late and not (is_over or cut[k]):
                    buffers.ended[0, k] = buffers.episodes[0, k]
            self.agents = [a for a in agents if not (terminations[a] or truncations[a])]
        return observations, gained, terminations, truncations, infos

    def _seats_of(self, agents: list[str]) -> list[int]:
        """Return the numbers of the karts of agents."""
        if agents is not self._seated:
            self._seated = agents
            self._seats = [self._numbers[agent] for agent in agents]
        return self._seats

    def _take(self, actions: dict[str, Any], numbers: list[int]) -> None:
        """Put the actions of agents into those of the batch. numbers: of the agents' karts."""
        given = self.batch.buffers.actions[0]
        width = given.shape[1]
        if not isinstance(actions, dict) or len(actions) != len(numbers):
            self.check_actions(actions)
        try:
            rows = [actions[agent] for agent in self.agents]
            shape = (len(numbers), width)
            with np.errstate(over="ignore"):
                if len(rows) == len(given) and {*map(len, rows)} == {width}:
                    np.concatenate(rows, out=given.reshape(-1), casting="same_kind")
                    return
                block = np.array(rows).astype(np.float32, casting="same_kind")
            if block.shape == shape or (width == 1 and block.shape == shape[:1]):
                given[:] = self._rest
                given[numbers] = block.reshape(shape)
                return
        except (KeyError, ValueError, TypeError):
            pass
        # One is missing, or it is not what it should be: which one?
        self.check_actions(actions)
        given[:] = self._rest
        for agent, k in zip(self.agents, numbers, strict=True):
            if agent in actions:
                given[k] = action_as(actions[agent], width, agent)

    def episode_of(self, agent: str) -> dict[str, Any]:
        """Return figures of the episode of an agent that ended last, see `Batch.episode_of`."""
        return self.batch.episode_of(0, self._numbers[agent])

    def _mask(self, infos: dict[str, dict[str, Any]]) -> None:
        """Add which discrete actions of each agent count, (15,) int8, as PettingZoo has it."""
        if self._is_discrete:
            masks = masks_for(self.action_space("kart_0"), self.batch.buffers.idle[0])
            for agent, info in infos.items():
                info["action_mask"] = masks[self._numbers[agent]].astype(np.int8)

    def save_state(self) -> bytes:
        """Return the state of the race, see `Batch.save_state`."""
        present = bytes(agent in self.agents for agent in self.possible_agents)
        return self.batch.save_state(own=_STEPS.pack(self._steps) + present)

    def load_state(self, state: bytes) -> dict[str, Vector]:
        """Put the race into a saved state; return what its agents see there."""
        return self._begin(self.batch.load_state(state))[0]

    def render(self) -> NDArray[np.uint8] | None:
        """Return the race as (height, width, 3) bytes (`rgb_array`), or show it in a window."""
        return self._camera.shoot()

    def close(self) -> None:
        """Close the window."""
        self._camera.close()
        self.batch.close()

    def state(self) -> Vector:
        """Return the state of the whole race, (S,): all karts, also those that no agent drives."""
        return global_states(self.batch.world)[0]


def parallel_env(
    task: Task | None = None,
    *,
    max_cycles: int = 0,
    render_mode: str | None = None,
    **options: Any,
) -> KartRace:
    """Return a race as a PettingZoo parallel environment.

    options: as for `race_task`, such as `track`, `karts` and `observation`, without a task.

    Raises:
        ScenarioError: a task, and options that make another.
    """
    if options and task is not None:
        raise ScenarioError(
            f"a task and {', '.join(options)}: give the task these, with `with_options`"
        )
    if options:
        task = race_task(**options)
    return KartRace(task, max_cycles=max_cycles, render_mode=render_mode)


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
