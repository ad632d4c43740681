"""A teacher: a scripted driver that may know the course, asked what it would do in a kart's place.

The world of imitation shows both what the learner sees and what the teacher sees; the learner's
numbers come first. Learning from a teacher that knows more than the learner can see:
Chen et al., "Learning by Cheating", CoRL 2019, https://arxiv.org/abs/1912.12294
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from race_server.autopilot import memory_size
from race_server.clock import TICK_S
from race_server.driver import driver_named
from race_server.env.actions import CONTINUOUS, CONTROL, action_kind
from race_server.env.batch import Batch, Task
from race_server.env.opponents import opponents_of
from race_server.errors import ScenarioError
from race_server.observe import PARTS, layout_of
from race_server.rules.items import items
from race_server.state import Floats

Labels = NDArray[np.float32]


def shown_to_both(task: Task, teacher: str) -> Task:
    """Return the task with what the teacher sees behind what the learner sees.

    Raises:
        DriverError: there is no such driver.
    """
    rays = task.scenarios[0].lidar.rays
    own = [PARTS[n].name for n in layout_of(task.observation, rays).numbers]
    seen = layout_of(driver_named(teacher).preset, rays).slices
    return replace(task, observation=(*own, *(name for name in seen if name not in own)))


class Teacher:
    """A scripted driver in the place of every learning kart of a batch."""

    def __init__(self, name: str, batch: Batch, caution: float) -> None:
        """Take a seat beside each learner. caution: share of the line's speeds that it drives.

        Raises:
            ScenarioError: the driver is no kernel, or the learner's actions are not pedals.
        """
        task, lidar = batch.task, batch.scenarios[0].lidar
        self._action = action_kind(task.action)
        if self._action not in {CONTINUOUS, CONTROL}:
            raise ScenarioError(
                f"action = {task.action!r}: a teacher shows pedals and wheel; choose 'continuous' "
                "or 'control'"
            )
        gear = np.array([lidar.field, lidar.reach, task.decision_ticks * TICK_S])
        names = tuple(item.name for item in items())
        (group,) = opponents_of((name,), 0, batch.learners, lidar.rays, gear, names)
        offered, wanted = batch.layout.slices, group.layout
        self._columns = np.concatenate(
            [np.arange(offered[part].start, offered[part].stop) for part in wanted.slices]
        )
        shape = (batch.worlds, batch.learners)
        self._views = np.zeros((*shape, wanted.size))
        self._scale = np.ones(wanted.size)
        if "line_speed_ahead" in wanted.slices:
            self._scale[wanted.slices["line_speed_ahead"]] = caution
        self._memory = np.zeros((*shape, memory_size(lidar.rays)))
        self._controls = np.zeros((*shape, 4))
        vehicles = batch.world.vehicles
        self._decide = group.driving(
            batch.worlds, self._views, vehicles, self._memory, self._controls
        )

    def labels(self, seen: NDArray[np.float32], begun: NDArray[np.bool_]) -> Labels:
        """Return the actions that the teacher would take, shape (W · L, A).

        seen: (W, L, size); begun: (W, L) true where an episode has just begun.
        """
        self._memory[begun] = 0.0
        self._views[...] = seen[..., self._columns] * self._scale
        self._decide()
        return actions_of(self._controls.reshape(-1, 4), self._action)


def actions_of(controls: Floats, kind: int) -> Labels:
    """Return what a learner would have to answer for these controls, shape (n, A).

    controls: (n, 4) steering, throttle, brake, buttons; kind: CONTINUOUS or CONTROL.
    """
    if kind == CONTROL:
        return controls.astype(np.float32)
    steering, throttle, brake, buttons = controls.T
    drive = np.where(brake > 0.0, -brake, throttle)
    return np.stack([drive, steering, buttons > 0.0], axis=1).astype(np.float32)
