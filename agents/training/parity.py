"""A policy's file beside the learner that it was exported from."""

from pathlib import Path
from typing import Any

from race_agents.policies.registry import BEST
from race_agents.policies.session import Policy
from race_agents.policies.verification import Rows
from race_agents.training.budget import Budget
from race_agents.training.checkpoint import load_checkpoint
from race_agents.training.export import difference
from race_agents.training.folder import settings_in
from race_agents.training.learner import learner_of, without_warnings, world_of
from race_agents.training.settings import Curiosity, Gail, Settings, Tracks
from race_agents.training.tasks import courses_of


def difference_in(run: Path, policy: Policy, seen: Rows) -> float:
    """Return the largest difference between a file and the best learner of its run.

    seen: (n, size) observations.

    Raises:
        ScenarioError: the run has no settings or no checkpoint, or they do not fit together.
    """
    settings = _small(settings_in(run))
    budget = Budget.of(settings)
    world = world_of(settings, budget)
    try:
        # Its minibatches do not fit the small world, in which nothing is trained.
        with without_warnings():
            learner = learner_of(settings, world, budget, None)
        load_checkpoint(run / BEST, learner, world, budget)
        return difference(policy, learner, world, seen)
    finally:
        world.close()


def _small(settings: Settings) -> Settings:
    """Return settings for the same learner in a smaller world, not for training."""
    first = courses_of(settings)[:1]
    place: dict[str, Any] = {"tracks": Tracks(names=first)}
    if settings.parks:
        place = {"parking": settings.parking.model_copy(update={"lots": first})}
    changes = {
        **place,
        "curriculum": (),
        # Their demonstrations may have been deleted.
        "gail": Gail(),
        "curiosity": Curiosity(),
    }
    return settings.model_copy(update=changes)
