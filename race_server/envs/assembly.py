"""What a batch is put together from: drivers, sensors, buffers."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from race_server.core.clock import TICK_S
from race_server.core.driver import as_parking
from race_server.core.observation import Layout, layout_of, offsets_of
from race_server.core.rules.items import items
from race_server.envs.actions import RESIDUAL, action_kind
from race_server.envs.buffers import Buffers, Sizes, make_buffers
from race_server.envs.called_opponent import CalledOpponent
from race_server.envs.opponents import Opponents, advised, opponents_of, opposition_of
from race_server.envs.rewards import weights_of
from race_server.envs.task import Task
from race_server.scenario.race import ABSENT, Scenario
from race_server.scenario.sensors import sensors_for


def opponents_for(task: Task, scenario: Scenario) -> list[Opponents]:
    """Return the scripted drivers: those of karts that do not learn, and those advised.

    Raises:
        ScenarioError, DriverError: a driver is unknown, or takes no advice.
    """
    learners, lidar = task.count_learners(), scenario.lidar
    gear = np.array([lidar.field, lidar.reach, task.decision_ticks * TICK_S])
    names = tuple(item.name for item in items())
    drivers = task.opponents or ("",)
    found = opponents_of(drivers, learners, scenario.karts, lidar.rays, gear, names)
    for group in found if scenario.course.lot is not None else ():
        if not isinstance(group.driver, CalledOpponent):
            as_parking(group.driver, group.name)
    if action_kind(task.action) == RESIDUAL:
        found += opponents_of((advised(task.base),), 0, learners, lidar.rays, gear, names)
    return found


def sensors_of(task: Task, karts: int, opponents: Sequence[Opponents]) -> tuple[int, ...]:
    """Return the sensors of every kart: those that its driver's observation needs."""
    learners = task.count_learners()
    own = sensors_for(_layout_of(task).slices) | task.discipline.sensors
    sensors = [own] * learners + [0] * (karts - learners)
    for group in opponents:
        for kart in group.karts:
            sensors[kart] |= sensors_for(group.layout.slices)
    return tuple(sensors)


def fitted_with(scenario: Scenario, sensors: tuple[int, ...]) -> Scenario:
    """Return a scenario whose karts carry these sensors; those that it leaves out stay away."""
    wanted = [scenario.fitted[k % len(scenario.fitted)] for k in range(scenario.karts)]
    fitted = tuple(
        ABSENT if before == ABSENT else now for before, now in zip(wanted, sensors, strict=True)
    )
    return replace(scenario, fitted=fitted)


def buffers_for(
    task: Task,
    scenarios: Sequence[Scenario],
    opponents: Sequence[Opponents],
    *,
    worlds: int,
    after: int,
) -> Buffers:
    """Return the buffers of a batch of a task.

    Raises:
        ScenarioError: its action, reward or reality gap is none.
    """
    discipline, karts, layout = task.discipline, scenarios[0].karts, _layout_of(task)
    settings: Mapping[str, float] = {
        "decision_ticks": task.decision_ticks,
        "action": action_kind(task.action),
        "after": after,
        "most_steps": task.most_steps,
        **discipline.settings,
    }
    return make_buffers(
        Sizes(
            worlds=worlds,
            karts=karts,
            learners=task.count_learners(),
            scenarios=len(scenarios),
            observation=layout.size,
            rays=scenarios[0].lidar.rays,
        ),
        discipline.figures,
        settings,
        offsets_of(layout),
        opposition_of(opponents, karts),
        weights_of(task.reward, discipline.terms, discipline.rewards),
        task.gap.ranges(),
    )


def _layout_of(task: Task) -> Layout:
    return layout_of(task.observation, task.scenarios[0].lidar.rays)
