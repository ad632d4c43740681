"""Put a training back to where its run ended."""

import json
from pathlib import Path
from typing import Any

import numpy as np

from race_agents.policies.registry import BEST, EVALUATION
from race_agents.training import curve
from race_agents.training.budget import Budget
from race_agents.training.callback import CURVE, LATEST
from race_agents.training.checkpoint import basis_in, elapsed_in, load_checkpoint
from race_agents.training.divergence import has_diverged
from race_agents.training.evaluation import basis_of
from race_agents.training.lines import Say
from race_agents.training.normaliser import Normaliser
from race_agents.training.settings import Settings
from race_server.core.seeds import resumed_seed
from race_server.errors import ScenarioError

OTHER_SCORE = (
    "policies are evaluated otherwise than before, so the next one is the best, whatever the best "
    "before had scored"
)


def is_evaluated(place: Path, done: int) -> bool:
    """Whether what a run had learned after `done` decisions has been evaluated and written."""
    return _evaluated_steps(place) == done


def has_gone_on(place: Path, settings: Settings) -> bool:
    """Whether a run has learned since its policy was written: it is running, or was killed."""
    written = _evaluated_steps(place)
    if written is None or not (place / LATEST).exists():
        return False  # a part of a run, such as a policy that was sent with its learner
    return written < elapsed_in(place / LATEST, settings).done


def _evaluated_steps(place: Path) -> int | None:
    """Return after how many decisions a run was evaluated and written, None if it was not."""
    try:
        return int(json.loads((place / EVALUATION).read_text(encoding="utf-8"))["steps"])
    except (OSError, ValueError, TypeError, KeyError):
        return None


def is_complete(place: Path, settings: Settings) -> bool:
    """Whether a run has learned for all the time of settings, and has been evaluated.

    Raises:
        ScenarioError: its checkpoint is damaged.
    """
    if not (place / LATEST).exists():
        return False
    budget = elapsed_in(place / LATEST, settings)
    return budget.is_over and is_evaluated(place, budget.done)


def restored(
    settings: Settings, place: Path, learner: Any, world: Normaliser, budget: Budget, say: Say
) -> float:
    """Put a learner and its world back to where a run ended; return the best score so far.

    Raises:
        ScenarioError: there is no run, or it has learned for all its time and is evaluated.
    """
    best_score = -np.inf
    if (place / BEST).exists() or not (place / LATEST).exists():
        best_score = load_checkpoint(place / BEST, learner, world, budget)
        if basis_in(place / BEST) not in {"", basis_of(settings)}:
            best_score = -np.inf
            say(OTHER_SCORE)
    load_checkpoint(place / LATEST, learner, world, budget)
    if has_diverged(learner):
        load_checkpoint(place / BEST, learner, world, budget)
        say(f"{LATEST} holds a network that has diverged: it goes on from {BEST}")
    curve.cut(place / CURVE, budget.done)  # what was learned after it is learned again
    if budget.is_over and is_evaluated(place, budget.done):
        world.close()
        raise ScenarioError(f"{place} has learned for {budget}: give it more than that, in all")
    if budget.is_over:
        say(f"it has learned for {budget}, so it is only evaluated and written")
    # Seeds other than at the beginning, and those of no exam.
    learner.set_random_seed(resumed_seed(settings.seed, budget.done))
    return best_score
