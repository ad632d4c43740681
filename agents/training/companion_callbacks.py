"""What goes on beside every training by reward, as its settings ask for it."""

from stable_baselines3.common.callbacks import BaseCallback

from race_agents.training.budget import Budget
from race_agents.training.cloning import Cloning
from race_agents.training.hurl import Mixing
from race_agents.training.normaliser import Normaliser
from race_agents.training.schedule import Schedule
from race_agents.training.settings import Settings


def callbacks_beside(settings: Settings, world: Normaliser, budget: Budget) -> list[BaseCallback]:
    """Return what a learner needs beside the callback that counts its decisions.

    Raises:
        RaceError: demonstrations are damaged, or do not fit the task.
    """
    beside: list[BaseCallback] = [Schedule(settings, budget)]
    if settings.cloning.demonstrations:
        beside.append(Cloning(settings, world, budget))
    if settings.mixes:
        beside.append(Mixing(settings, budget))
    return beside
