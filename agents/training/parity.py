"""A policy's file beside the learner that it was exported from."""

from pathlib import Path

from agents.policies.proof import Rows
from agents.policies.session import Policy
from agents.policies.shelf import BEST
from agents.training.checkpoint import load_checkpoint
from agents.training.courses import names_of
from agents.training.export import difference
from agents.training.folder import settings_in
from agents.training.learner import learner_of, world_of
from agents.training.pace import Pace
from agents.training.settings import Curiosity, Gail, Settings, Tracks


def difference_in(run: Path, policy: Policy, seen: Rows) -> float:
    """Return by how much a file answers at most otherwise than the best learner of its run.

    seen: (n, size) observations.

    Raises:
        ScenarioError: the run has no settings or no checkpoint, or they do not fit together.
    """
    settings = _small(settings_in(run))
    pace = Pace.of(settings)
    world = world_of(settings, pace)
    try:
        learner = learner_of(settings, world, pace, None)
        load_checkpoint(run / BEST, learner, world, pace)
        return difference(policy, learner, world, seen)
    finally:
        world.close()


def _small(settings: Settings) -> Settings:
    """Return what makes the same learner in a smaller world: nothing is to be learned."""
    first = names_of(settings.tracks)[0]
    changes = {
        "tracks": Tracks(names=(first,)),
        "curriculum": (),
        # Their demonstrations may be gone.
        "gail": Gail(),
        "curiosity": Curiosity(),
    }
    return settings.model_copy(update=changes)
