"""Actor and critic of dense layers, with their gradients of PPO's loss written out.

numpy calculates, on the weights of SB3's own policy: its library multiplies matrices on AMD's
processors twice as fast as PyTorch's, and its hyperbolic tangent takes a tenth of the time. Nothing
is recorded for a backward pass, and every array is made once. Actor and critic may learn on two
threads, and a minibatch may be cut in parts of nearly equal size: numpy lets go of the interpreter
while it calculates.

Axis letters: n rows of a part, S numbers of an observation, A of an action.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from stable_baselines3.common.distributions import DiagGaussianDistribution
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.torch_layers import FlattenExtractor
from torch import nn

from race_agents.training.half_stack import stack_of
from race_agents.training.stack import Layer, Rows

HALF_LOG_TAU = np.float32(0.5 * np.log(2.0 * np.pi))


def layers_of(policy: Any) -> tuple[list[Layer], list[Layer]] | None:
    """Return the layers of actor and critic, None where they are not dense and apart."""
    fits = (
        isinstance(policy, ActorCriticPolicy)
        and type(policy.action_dist) is DiagGaussianDistribution
        and isinstance(policy.features_extractor, FlattenExtractor)
        and not policy.use_sde
    )
    if not fits:
        return None
    extractor = policy.mlp_extractor
    actor = _dense([*extractor.policy_net, policy.action_net])
    critic = _dense([*extractor.value_net, policy.value_net])
    return (actor, critic) if actor and critic else None


def _dense(modules: list[nn.Module]) -> list[Layer]:
    """Return modules as layers; none where one is of another kind."""
    layers = []
    for module, behind in zip(modules[::2], [*modules[1::2], None], strict=True):
        bends = {nn.Tanh: "tanh", nn.ReLU: "relu", type(None): ""}.get(type(behind))
        if not isinstance(module, nn.Linear) or bends is None or module.bias is None:
            return []
        layers.append(Layer(module.weight.data.numpy(), module.bias.data.numpy(), bends))
    return layers


@dataclass(frozen=True)
class Lesson:
    """One part of a minibatch of PPO. Shapes: (n, what the critic knows), (n, A), (n,)."""

    known: Rows
    acted: Rows
    advantages: Rows
    returns: Rows
    log_chances: Rows  # of the actions when they were drawn
    share: float  # 1 / rows of the whole minibatch


@dataclass
class Told:
    """What a part tells of its lesson: sums over its rows, as shares of the minibatch."""

    policy_loss: float = 0.0
    value_loss: float = 0.0
    change: float = 0.0  # an estimate of the Kullback-Leibler divergence
    clipped: float = 0.0


class GaussianMlp:
    """Actor and critic of one part; they share nothing, so that two threads may teach them."""

    def __init__(
        self, actor: list[Layer], critic: list[Layer], rows: int, *, halves: bool = False
    ) -> None:
        """Make room for up to n rows. halves: inner products are of bfloat16."""
        self.actor = stack_of(actor, rows, halves=halves)
        self.critic = stack_of(critic, rows, halves=halves)
        self.spread_gradient = np.zeros(len(actor[-1].bias), np.float32)
        pairs = [*self.actor.gradients, *self.critic.gradients]
        # By the logarithms of spreads, then by weights and biases from the actor's first layer on.
        self.gradients = [self.spread_gradient, *(each for pair in pairs for each in pair)]
        self._seen = actor[0].weight.shape[1]  # the first numbers of what the critic knows

    def renew(self) -> None:
        """Take parameters that have changed."""
        self.actor.renew()
        self.critic.renew()

    def act(self, known: Rows) -> Rows:
        """Return the actor's answers (n, A) to what is seen, the first part of what is known."""
        return self.actor.answer(known[:, : self._seen])

    def value(self, known: Rows) -> Rows:
        """Return the critic's answers (n,), which stay as they are."""
        return self.critic.answer(known)[:, 0].copy()

    def teach_actor(self, lesson: Lesson, log_spread: Rows, clip: float) -> Told:
        """Fill the gradients of its loss.

        log_spread: (A,) of the actions' deviations; clip: of the ratio of chances.
        """
        told, share = Told(), np.float32(lesson.share)
        spread: Any = np.exp(log_spread)
        off: Rows = (lesson.acted - self.act(lesson.known)) / spread
        squares = off * off
        chances = -0.5 * squares.sum(axis=1) - np.float32((log_spread + HALF_LOG_TAU).sum())
        ratio_log = chances - lesson.log_chances
        ratio = np.exp(ratio_log)
        gain = lesson.advantages * ratio
        clipped = lesson.advantages * np.clip(ratio, 1.0 - clip, 1.0 + clip)
        is_outside = np.abs(ratio - 1.0) > clip
        # The lesser of both counts; outside the limits the clipped one teaches nothing.
        slope = np.where(is_outside & (gain >= clipped), np.float32(0.0), -gain * share)
        np.multiply(off, slope[:, None], out=off)
        self.spread_gradient[:] = (slope[:, None] * (squares - 1.0)).sum(axis=0)
        np.divide(off, spread, out=off)
        self.actor.learn(off)
        told.policy_loss = -float(np.minimum(gain, clipped).sum()) * lesson.share
        told.change = float((ratio - 1.0 - ratio_log).sum()) * lesson.share
        told.clipped = float(is_outside.sum()) * lesson.share
        return told

    def teach_critic(self, lesson: Lesson, weight: float) -> Told:
        """Fill the gradients of its loss, which counts with `weight`."""
        error = self.critic.answer(lesson.known)[:, 0] - lesson.returns
        self.critic.learn((np.float32(2.0 * weight * lesson.share) * error)[:, None])
        return Told(value_loss=float(np.dot(error, error)) * lesson.share)
