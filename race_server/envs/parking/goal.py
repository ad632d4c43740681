"""Goals apart from observations, as hindsight experience replay needs them.

A goal is a pose in the frame of the lot, with the speed there: (x, y, cos, sin, speed), lengths in
tens of metres, speed as a share of the vehicle's top speed. With a trailer cosine and sine of its
heading stand before the speed. The reward is a plain function of two such goals, so that a replay
buffer may ask what it would have been for another one.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from race_server.core.level import Level
from race_server.core.observation import Layout
from race_server.envs.task import Task
from race_server.errors import ScenarioError
from race_server.scenario.level import level_named

Array = NDArray[Any]

OWN = (
    *("radar", "radar_before", "speed", "lateral_speed", "yaw_rate", "steering"),
    *("heading_cos", "heading_sin"),
)
POSE = ("position_x", "position_y")
SLOT = ("slot_x", "slot_y", "slot_heading")
PARTS = (*OWN, *POSE, *SLOT)
OWN_WITH_TRAILER = (
    *("feelers", "speed", "lateral_speed", "yaw_rate", "steering", "heading_cos", "heading_sin"),
    "hitch",
)
TRAILER_PARTS = (*OWN_WITH_TRAILER, *POSE, *SLOT)
METRES = 10.0  # that make 1 in a goal
# Of the dense reward: how much each number of a goal counts.
WEIGHTS = np.array([1.0, 1.0, 0.2, 0.2, 0.05])
TRAILER_WEIGHTS = np.array([1.0, 1.0, 0.2, 0.2, 0.2, 0.2, 0.05])
REWARDS = ("sparse", "dense")
# As much as -1 at each decision for ever with a discount of 0.95: with the sparse reward no crash
# is better than a slot that is never reached. The dense reward falls below -1 some 10 m from the
# slot; farther away a crash costs less than to stand for ever.
CRASH = -20.0


class Room(NamedTuple):
    """A slot, and the body of a vehicle without trailers that has to fit into it, in metres."""

    slot_length: float
    slot_width: float
    length: float
    width: float


@dataclass(frozen=True)
class GoalView:
    """Splits what a vehicle sees into observation, achieved goal and desired goal."""

    layout: Layout
    level: Level
    top_speed: float  # [m/s]
    reward: str = "sparse"
    room: Room | None = None  # where all slots have one size, and no trailer is drawn

    @staticmethod
    def of(task: Task, layout: Layout, reward: str) -> "GoalView":
        """Return the view of a task whose observation is `PARTS` or `TRAILER_PARTS`.

        Raises:
            ScenarioError: there is no such reward, or the level judges the trailer alone.
        """
        if reward not in REWARDS:
            raise ScenarioError(f"reward {reward!r}: choose one of {', '.join(REWARDS)}")
        scenario = task.scenarios[0]
        assert scenario.course.lot is not None
        level = scenario.level or level_named(scenario.course.lot.level)
        if level.last:
            raise ScenarioError(
                "goals hold the place of the vehicle, and this level judges its last trailer; "
                "choose another, such as goal-trailer"
            )
        vehicle, lot = scenario.vehicle_of(0), scenario.course.lot
        sizes = {(length, width) for length, width in lot.slots[:, 3:].tolist()} or {lot.slot_size}
        room = None
        if len(sizes) == 1 and not vehicle.trailers:
            ((length, width),) = sizes
            room = Room(length, width, vehicle.length, vehicle.width)
        return GoalView(layout, level, vehicle.top_speed, reward, room)

    @property
    def own(self) -> tuple[str, ...]:
        """The parts of what is called `observation`."""
        return OWN_WITH_TRAILER if "hitch" in self.layout.slices else OWN

    @property
    def weights(self) -> Array:
        """Of the dense reward: how much each number of a goal counts, (5,) or (7,)."""
        return TRAILER_WEIGHTS if "hitch" in self.layout.slices else WEIGHTS

    @property
    def space(self) -> spaces.Dict:
        """The space of what `split` returns."""
        place = np.arange(self.layout.size)
        own = np.concatenate([place[self.layout.slices[name]] for name in self.own])
        low, high = self.layout.lows()[own], self.layout.highs()[own]
        turns = np.ones(4 if "hitch" in self.own else 2)
        goal = np.array([100.0, 100.0, *turns, 10.0], np.float32)
        return spaces.Dict(
            {
                "observation": spaces.Box(low, high, dtype=np.float32),
                "achieved_goal": spaces.Box(-goal, goal, dtype=np.float32),
                "desired_goal": spaces.Box(-goal, goal, dtype=np.float32),
            }
        )

    def split(self, seen: Array) -> dict[str, Array]:
        """Return what is seen, (..., size), by name; goals have the shape (..., 5) or (..., 7)."""
        part = {name: seen[..., place] for name, place in self.layout.slices.items()}
        heading = part["slot_heading"]
        achieved = [part[name] / METRES for name in POSE]
        cos, sin = part["heading_cos"], part["heading_sin"]
        achieved += [cos, sin]
        desired = [part["slot_x"] / METRES, part["slot_y"] / METRES]
        desired += [np.cos(heading), np.sin(heading)]
        if "hitch" in part:
            bent_cos, bent_sin = np.cos(part["hitch"]), np.sin(part["hitch"])
            achieved += [cos * bent_cos + sin * bent_sin, sin * bent_cos - cos * bent_sin]
            desired += desired[2:4]
        achieved.append(part["speed"] / self.top_speed)
        desired.append(np.zeros_like(heading))
        own = [part[name] for name in self.own]
        columns = {"observation": own, "achieved_goal": achieved, "desired_goal": desired}
        return {
            name: np.concatenate(parts, axis=-1).astype(np.float32)
            for name, parts in columns.items()
        }

    def rewards(
        self, achieved: Array, desired: Array, infos: Mapping[str, Any] | Sequence[Any]
    ) -> Array:
        """Return the rewards, shape (n,), or a number for a single pair of goals.

        achieved, desired: (n, g) or (g,); infos: of each step, or one of all, in which `crashed`
        may be an array, as Gymnasium's vectors have it; what crashed costs more, whatever the goal.

        Raises:
            ScenarioError: the goals have another shape or are no numbers, or the infos are none.
        """
        achieved, desired = self._goals("achieved", achieved), self._goals("desired", desired)
        if achieved.shape != desired.shape:
            raise ScenarioError(
                f"achieved goals of the shape {achieved.shape}, desired ones of {desired.shape}: "
                "give one of each for every step"
            )
        if self.reward == "sparse":
            reward = is_reached(self.level, achieved, desired, self.top_speed, self.room) - 1.0
        else:
            # Not a matrix product, which rounds a single goal differently.
            reward = -np.sqrt((np.abs(achieved - desired) * self.weights).sum(axis=-1))
        return np.asarray(reward + CRASH * _crashed(infos, reward.shape))

    def _goals(self, name: str, given: Any) -> Array:
        size = len(self.weights)
        try:
            goals = np.asarray(given)
        except ValueError:  # rows of several lengths
            goals = np.empty(0)
        is_shaped = goals.ndim in (1, 2) and goals.shape[-1] == size
        if not is_shaped or goals.dtype.kind not in "fiu" or not np.isfinite(goals).all():
            raise ScenarioError(
                f"{name} goals {given!r:.60}: give finite numbers of the shape (n, {size}) or "
                f"({size},)"
            )
        return goals


def _crashed(infos: Mapping[str, Any] | Sequence[Any], shape: tuple[int, ...]) -> Array:
    """Return 1 where a vehicle crashed, and 0 elsewhere: (n,), or () of a single info.

    shape: of the rewards.
    """
    if isinstance(infos, Mapping):
        told: Any = infos.get("crashed", False)
    elif not isinstance(infos, Sequence | np.ndarray) or not all(
        isinstance(one, Mapping) for one in infos
    ):
        raise ScenarioError(
            f"infos = {infos!r:.60}: give that of each step, a dict; a crash stands there"
        )
    elif untold := [row for row, one in enumerate(infos) if "crashed" not in one]:
        raise ScenarioError(
            f"info {untold[0]} has no 'crashed': give what the step told; a replay buffer of "
            "Stable-Baselines3 keeps it with copy_info_dict=True"
        )
    else:
        told = [one["crashed"] for one in infos]
    try:
        crashed = np.asarray(told, np.bool_).astype(np.float64)
    except ValueError as error:  # rows of several lengths
        raise ScenarioError(f"infos: crashed = {told!r:.60}: give one truth value each") from error
    if crashed.shape not in {(), shape}:
        raise ScenarioError(
            f"{len(crashed)} infos for rewards of the shape {shape}: give one for each step"
        )
    return crashed


def is_reached(
    level: Level, achieved: Array, desired: Array, top_speed: float, room: Room | None = None
) -> NDArray[np.bool_]:
    """Return where goals (..., g) are reached, but for the time to hold, shape (...).

    level: whose tolerances count; top_speed: that makes 1 in a goal [m/s]; room: of the corners,
    which do not count without it.
    """
    dx, dy = np.moveaxis(METRES * (achieved - desired)[..., :2], -1, 0)
    cos, sin = np.moveaxis(desired[..., 2:4], -1, 0)
    along, across = dx * cos + dy * sin, dy * cos - dx * sin
    straight = achieved[..., 2] * cos + achieved[..., 3] * sin  # cosine of the turn
    holds = np.ones(np.shape(dx), np.bool_)
    if level.within:
        holds &= np.hypot(along, across) < level.within
    if level.along:
        holds &= np.abs(along) < level.along
    if level.across:
        holds &= np.abs(across) < level.across
    if level.turn:
        holds &= straight >= np.cos(level.turn)
    if level.fits and room is not None:
        cos_turn, sin_turn = abs(straight), abs(achieved[..., 3] * cos - achieved[..., 2] * sin)
        half_along = 0.5 * (room.length * cos_turn + room.width * sin_turn)
        half_across = 0.5 * (room.length * sin_turn + room.width * cos_turn)
        holds &= np.abs(along) + half_along <= 0.5 * room.slot_length
        holds &= np.abs(across) + half_across <= 0.5 * room.slot_width
    if level.hitch and achieved.shape[-1] == len(TRAILER_WEIGHTS):
        bent = achieved[..., 2] * achieved[..., 4] + achieved[..., 3] * achieved[..., 5]
        holds &= bent >= np.cos(level.hitch)
    if level.still:
        holds &= np.abs(achieved[..., -1]) * top_speed < level.still
    return holds
