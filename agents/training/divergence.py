"""Recognise a network that has diverged: its numbers are none, or too large to answer with."""

from typing import Any

import torch

MOST = 1e9  # of a weight: products of larger ones are soon no numbers

ENDED = (
    "the network has diverged, as numbers of it are none or grow without bounds: the learning ends "
    "here, and the best policy so far is evaluated and written; a smaller algorithm.learning_rate "
    "may hold, and --resume goes on from the last sound checkpoint"
)


class DivergedError(Exception):
    """The network has diverged, so there is nothing to save."""


def has_diverged(learner: Any) -> bool:
    """Whether a weight of a learner's networks, or a deviation of its actions, is out of bounds."""
    with torch.no_grad():
        largest = [weight.abs().max() for weight in learner.policy.parameters() if weight.numel()]
        deviation = getattr(learner.policy, "log_std", None)
        if isinstance(deviation, torch.Tensor):
            largest.append(deviation.exp().max())
        # A number that is none is not below the bound either.
        return not bool(torch.stack([one.float() for one in largest]).max() < MOST)


def check_sound(learner: Any) -> None:
    """Check that a learner's networks have not diverged.

    Raises:
        DivergedError: they have.
    """
    if has_diverged(learner):
        raise DivergedError
