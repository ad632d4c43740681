"""The training world: batch, PettingZoo, Gymnasium, Stable-Baselines3.

Importing it registers the ids of Gymnasium and PettingZoo. What it exports is imported when it is
first used: PyTorch and Stable-Baselines3 only with `KartVecEnv`.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from race_server.envs.registration import register_gymnasium, register_pettingzoo

if TYPE_CHECKING:
    from race_server.envs.batch import Batch, Curriculum
    from race_server.envs.buffers import REENTER, RESET_WORLD, STAY
    from race_server.envs.called_opponent import CalledOpponent
    from race_server.envs.parallel import KartRace, env, parallel_env
    from race_server.envs.presets import (
        LEARNING_RULES,
        mixed_task,
        parking_task,
        race_task,
        scenario_on,
        task_on,
        time_trial_task,
    )
    from race_server.envs.racing import Racing
    from race_server.envs.reality_gap import RealityGap
    from race_server.envs.sb3 import KartVecEnv
    from race_server.envs.single import OneKart
    from race_server.envs.task import Discipline, Task
    from race_server.envs.vector import KartVectorEnv

__all__ = [
    "LEARNING_RULES",
    "REENTER",
    "RESET_WORLD",
    "STAY",
    "Batch",
    "CalledOpponent",
    "Curriculum",
    "Discipline",
    "KartRace",
    "KartVecEnv",
    "KartVectorEnv",
    "OneKart",
    "Racing",
    "RealityGap",
    "Task",
    "env",
    "mixed_task",
    "parallel_env",
    "parking_task",
    "race_task",
    "scenario_on",
    "task_on",
    "time_trial_task",
]

_MODULES = {
    "batch": ("Batch", "Curriculum"),
    "called_opponent": ("CalledOpponent",),
    "buffers": ("REENTER", "RESET_WORLD", "STAY"),
    "parallel": ("KartRace", "env", "parallel_env"),
    "presets": (
        *("LEARNING_RULES", "mixed_task", "parking_task", "race_task"),
        *("scenario_on", "task_on", "time_trial_task"),
    ),
    "racing": ("Racing",),
    "reality_gap": ("RealityGap",),
    "sb3": ("KartVecEnv",),
    "single": ("OneKart",),
    "task": ("Discipline", "Task"),
    "vector": ("KartVectorEnv",),
}
_HOMES = {name: module for module, names in _MODULES.items() for name in names}

register_gymnasium()
register_pettingzoo()


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
