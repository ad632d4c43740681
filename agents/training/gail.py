"""Generative adversarial imitation learning (GAIL).

A discriminator learns to distinguish driving from demonstrations, and rewards what it takes for a
demonstration: Ho and Ermon, NeurIPS 2016, https://arxiv.org/abs/1606.03476
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch.nn import functional

from race_agents.training.demonstrations import pairs_for
from race_agents.training.reward_wrapper import Rows, RunningScale, network
from race_agents.training.settings import Gail, Settings
from race_server.core.messages import Button
from race_server.envs.actions import CONTINUOUS, CONTROL, action_kind
from race_server.envs.presets import LEARNING_RULES
from race_server.scenario.parking import LOT_RULES


class Discriminator:
    """A judge that rewards what looks like the demonstrations."""

    name = "gail"

    def __init__(self, settings: Settings) -> None:
        """Read the demonstrations.

        Raises:
            RaceError: they are damaged, or do not fit the task.
        """
        wanted: Gail = settings.gail
        self._wanted = wanted
        self._kind = action_kind(settings.action)
        usual = LOT_RULES if settings.parks else LEARNING_RULES
        has_items = settings.race.rules.get("items", usual.items)
        self._buttons = int(Button.ACCEPT_RESCUE | (Button.USE_ITEM if has_items else 0))
        self._seen, shown = pairs_for(settings, Path(wanted.demonstrations))
        self._actions = self._as_taken(shown)
        size = self._seen.shape[1] + self._actions.shape[1]
        self._network = network((size, *wanted.layers, 1), settings.seed)
        self._optimiser = torch.optim.Adam(self._network.parameters(), lr=wanted.learning_rate)
        self._scale = RunningScale(size)
        self._scale.update(np.concatenate([self._seen, self._actions], axis=1))
        self._chance = np.random.default_rng(settings.seed)

    def worth(self, seen: Rows, actions: Rows, after: Rows) -> Rows:
        """Return -log(1 - D) for each transition, shape (n,), D being the chance of an expert."""
        with torch.no_grad():
            logits = self._logit(seen, self._as_taken(actions))
            return np.asarray(self._wanted.scale * functional.softplus(logits))

    def learn(self, seen: Rows, actions: Rows, after: Rows) -> None:
        """Train to distinguish driving from demonstrations."""
        count, actions = self._wanted.batch_size, self._as_taken(actions)
        for _ in range(self._wanted.lessons):
            own = self._chance.integers(0, len(seen), count)
            shown = self._chance.integers(0, len(self._seen), count)
            logits = torch.cat(
                [
                    self._logit(seen[own], actions[own], self._wanted.blur),
                    self._logit(self._seen[shown], self._actions[shown], self._wanted.blur),
                ]
            )
            truth = torch.cat([torch.zeros(count), torch.ones(count)])
            loss: Any = functional.binary_cross_entropy_with_logits(logits, truth)
            self._optimiser.zero_grad()
            loss.backward()
            self._optimiser.step()

    def state(self) -> dict[str, Any]:
        """Return network, optimiser and scale. The demonstrations stay in their file."""
        return {
            "network": self._network.state_dict(),
            "optimiser": self._optimiser.state_dict(),
            "scale": self._scale.state(),
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """Restore a state that `state` returned."""
        self._network.load_state_dict(state["network"])
        self._optimiser.load_state_dict(state["optimiser"])
        self._scale.restore(state["scale"])

    def _as_taken(self, actions: Rows) -> Rows:
        """Return actions as the world takes them, (n, A): the last number is of the buttons.

        Only which of them are pressed counts, and without items none to use one.
        """
        if self._kind not in {CONTINUOUS, CONTROL}:
            return actions
        taken, last = actions.copy(), actions[:, -1]
        pressed = last > 0.5 if self._kind == CONTINUOUS else last
        taken[:, -1] = pressed.astype(np.int64) & self._buttons
        return taken

    def _logit(self, seen: Rows, actions: Rows, blur: float = 0.0) -> torch.Tensor:
        """Return the logit that pairs are the expert's, shape (n,); blur: noise on all inputs."""
        pairs = self._scale(np.concatenate([seen, actions], axis=1))
        if blur > 0.0:
            noise = self._chance.normal(0.0, blur, tuple(pairs.shape)).astype(np.float32)
            pairs = pairs + torch.from_numpy(noise)
        return torch.as_tensor(self._network(pairs))[:, 0]
