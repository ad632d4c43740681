"""A teacher: a scripted driver that may know the course, and labels the states of a learner.

The world of imitation has the observations of learner and teacher; the learner's come first.
Learning from a teacher that knows more than the learner can observe: Chen et al., "Learning by
Cheating", CoRL 2019, https://arxiv.org/abs/1912.12294
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from race_agents.planning.care import LESS, STRETCHES
from race_agents.planning.latency import COMMAND, COMMANDS
from race_agents.training.warm_start_settings import WarmStart
from race_server.core.clock import TICK_S
from race_server.core.driver import driver_named
from race_server.core.kernel_driver import ASIDE, FETCH, PRESSED, SHIFT, memory_size
from race_server.core.messages import Button
from race_server.core.observation import PARTS, layout_of
from race_server.core.rules.items import items
from race_server.core.state import Floats
from race_server.envs.actions import (
    BRAKED,
    CONTINUOUS,
    CONTROL,
    PEDAL,
    RESIDUAL,
    REVERSE_BELOW,
    WIDTHS,
    action_kind,
)
from race_server.envs.advice import advice_of
from race_server.envs.batch import Batch
from race_server.envs.opponents import Opponents, opponents_of, takes_advice
from race_server.envs.task import Task
from race_server.errors import ScenarioError

Labels = NDArray[np.float32]


def shown_to_both(task: Task, teacher: str) -> Task:
    """Return the task with the observation of the teacher behind that of the learner.

    Raises:
        DriverError: there is no such driver.
    """
    rays = task.scenarios[0].lidar.rays
    own = [PARTS[n].name for n in layout_of(task.observation, rays).numbers]
    seen = layout_of(driver_named(teacher).preset, rays).slices
    return replace(task, observation=(*own, *(name for name in seen if name not in own)))


class Teacher:
    """A scripted driver in the place of every learning kart of a batch.

    memory: its state between decisions, shape (W, L, M).
    """

    def __init__(self, wanted: WarmStart, batch: Batch) -> None:
        """Prepare a driver for each learner.

        Raises:
            ScenarioError: the driver is no kernel, the learner's actions are not pedals, or the
                advice does not fit.
        """
        task, lidar = batch.task, batch.scenarios[0].lidar
        self._action = action_kind(task.action)
        if self._action not in {CONTINUOUS, CONTROL}:
            raise ScenarioError(
                f"action = {task.action!r}: a teacher answers with pedals and steering; choose "
                "'continuous' or 'control'"
            )
        gear = np.array([lidar.field, lidar.reach, task.decision_ticks * TICK_S])
        names = tuple(item.name for item in items())
        (group,) = opponents_of((wanted.teacher,), 0, batch.learners, lidar.rays, gear, names)
        offered, seen = batch.layout.slices, group.layout
        self._columns = np.concatenate(
            [np.arange(offered[part].start, offered[part].stop) for part in seen.slices]
        )
        shape = (batch.worlds, batch.learners)
        self._views = np.zeros((*shape, seen.size))
        self._scale = np.ones(seen.size)
        self._on_line = "line_speed_ahead" in seen.slices
        if self._on_line:
            self._scale[seen.slices["line_speed_ahead"]] = wanted.caution
        self._speeds = self._views[..., seen.slices["speed"].start]
        self._reach = wanted.lane_reach if "line_offset" in seen.slices else None
        if self._reach is not None:
            self._offsets = self._views[..., seen.slices["line_offset"].start]
        self.memory = np.zeros((*shape, memory_size(lidar.rays)))
        self._controls = np.zeros((*shape, 4))
        self._advice = _advice_to(group, wanted.advice, float(batch.world.vehicles[0, 0].width))
        self._decide = group.driving(batch.world, self._views, self.memory, self._controls)

    def labels(self, seen: NDArray[np.float32], begun: NDArray[np.bool_]) -> Labels:
        """Return the actions that the teacher would take, shape (W · L, A).

        seen: (W, L, size); begun: (W, L) true where an episode has just begun.
        """
        self.memory[begun] = 0.0
        # Whether to press a button does not depend on its last answer.
        self.memory[..., PRESSED] = 0.0
        self.memory[..., ASIDE : FETCH + 1] = self._advice
        if self._on_line:
            # Where it would be slower, since the learner came too near to a border, none can see.
            self.memory[..., LESS : LESS + STRETCHES] = 0.0
        self._views[...] = seen[..., self._columns] * self._scale
        if self._reach is not None:
            lanes, at = self.memory[..., SHIFT], self._offsets
            np.clip(lanes, at - self._reach, at + self._reach, out=lanes)
        self._decide()
        controls = self._controls.reshape(-1, 4)
        return actions_of(controls, self._action, self._speeds.ravel())

    def record_driven(self, actions: NDArray[np.float32]) -> None:
        """Record the actions driven instead of its answers, by which it knows the steering lag.

        actions: (W · L, A)
        """
        driven = controls_of(actions, self._action).reshape(*self.memory.shape[:2], COMMAND)
        self.memory[..., COMMANDS : COMMANDS + COMMAND] = driven


def _advice_to(teacher: Opponents, advice: Sequence[float], width: float) -> Floats:
    """Return the advice as a driver's memory holds it, shape (6,); width: of the vehicle [m]."""
    if not advice:
        return np.zeros(WIDTHS[RESIDUAL])
    if len(advice) != WIDTHS[RESIDUAL] or not takes_advice(teacher.driver):
        raise ScenarioError(
            f"warm_start.advice = {list(advice)} to {teacher.name!r}: give {WIDTHS[RESIDUAL]} "
            "numbers to a driver on the reference line, raceline or idm"
        )
    return advice_of(np.array(advice, np.float32), width)


def actions_of(controls: Floats, kind: int, speeds: Floats) -> Labels:
    """Return the actions of a learner that give these controls, shape (n, A).

    controls: (n, 4) steering, throttle, brake, buttons; kind: CONTINUOUS, CONTROL, or of a lot
    PEDAL or BRAKED; speeds: (n,) [m/s], since a learner that brakes while it stands drives
    backwards.
    """
    if kind == CONTROL:
        return controls.astype(np.float32)
    steering, throttle, brake, buttons = controls.T
    if kind == BRAKED:
        return np.stack([throttle, steering, brake], axis=1).astype(np.float32)
    if kind == PEDAL:
        # The one pedal against the motion brakes, both ways.
        against = np.where(np.abs(speeds) > REVERSE_BELOW, -np.sign(speeds), 0.0)
        drive = np.where(brake > 0.0, against * brake, throttle)
        return np.stack([drive, steering], axis=1).astype(np.float32)
    braking = np.where(speeds > REVERSE_BELOW, -brake, 0.0)
    drive = np.where(brake > 0.0, braking, throttle)
    uses_item = buttons.astype(np.int64) & Button.USE_ITEM
    return np.stack([drive, steering, uses_item], axis=1).astype(np.float32)


def controls_of(actions: NDArray[np.float32], kind: int) -> Floats:
    """Return steering, throttle and brake of a learner's actions, shape (n, 3)."""
    if kind == CONTROL:
        return actions[:, :COMMAND].astype(np.float64)
    drive, steering = actions[:, 0], actions[:, 1]
    return np.stack(
        [steering, np.maximum(drive, 0.0), np.maximum(-drive, 0.0)], axis=1, dtype=np.float64
    )
