"""Tasks of learning on the small ring."""

from dataclasses import replace
from typing import Any

from race_server.envs.presets import LEARNING_RULES, task_on
from race_server.envs.task import Task
from race_server.scenario.race import Rules, Scenario
from support.courses import SMALL_RING

# Without laps, items and time limits: an episode ends where a test wants it to.
FREE = replace(LEARNING_RULES, laps=0, items=False, stopped_limit_s=0.0, limit_s=0.0)


def ring_task(karts: int = 2, rules: Rules = FREE, **options: Any) -> Task:
    """Return a task of racing; options as for `task_on`."""
    return task_on((Scenario(SMALL_RING, karts=karts, rules=rules),), **options)
