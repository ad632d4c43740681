"""Checkpoints: weights, optimisers, normalisation and counters as plain tensors.

They also hold what learns beside the learner: judges with their networks, the curriculum. They are
read with PyTorch's restricted reader, which unpickles no code.
"""

import io
from collections.abc import Mapping
from copy import deepcopy
from pathlib import Path
from pickle import UnpicklingError
from typing import Any, Protocol

import numpy as np
import torch
from stable_baselines3.common.vec_env import VecEnv, VecEnvWrapper

from race_agents.training.budget import Budget
from race_agents.training.curriculum import Curriculum
from race_agents.training.normaliser import LEAST_VARIANCE, Normaliser, restore_means, state_of
from race_agents.training.reward_wrapper import RewardWrapper
from race_agents.training.settings import Settings
from race_server.envs.sb3 import KartVecEnv
from race_server.errors import ScenarioError
from race_server.kept_file import write_file

COUNTERS = ("num_timesteps", "_n_updates", "_episode_num")
CURRICULUM = "curriculum"
ENTROPY = "log_ent_coef"
RETURN = "return_"  # in front of the names of the rewards' means
STRETCH = "stretch"
MOST_WORDS = 200  # characters of an error of PyTorch


class Companion(Protocol):
    """A part of a world with a state that checkpoints keep."""

    def state(self) -> dict[str, Any]:
        """Return its state."""

    def restore(self, state: Mapping[str, Any]) -> None:
        """Restore a state that `state` returned."""


def companions_in(world: VecEnv) -> dict[str, Companion]:
    """Return the companions of a learner in a world, by name: judges and the curriculum."""
    found: dict[str, Companion] = {}
    while isinstance(world, VecEnvWrapper):
        if isinstance(world, RewardWrapper):
            found[world.judge.name] = world.judge
        world = world.venv
    if isinstance(world, KartVecEnv) and isinstance(world.curriculum, Curriculum):
        found[CURRICULUM] = world.curriculum
    return found


def _weights_beside(learner: Any) -> dict[str, torch.Tensor]:
    """Return what a learner trains besides its networks: SAC's weight of the entropy."""
    weight = getattr(learner, ENTROPY, None)
    return {} if weight is None else {ENTROPY: weight.detach()}


def save_checkpoint(
    path: Path,
    learner: Any,
    world: Normaliser,
    budget: Budget,
    score: float = 0.0,
    basis: str = "",
) -> None:
    """Write the state of a training, and the score of its policy if it was the best.

    basis: what the score was made by, see `evaluation.basis_of`.
    """
    seen: Any = world.obs_rms  # one box, hence one set of means
    returns = {RETURN + name: value for name, value in state_of(world.ret_rms).items()}
    stretch = np.empty(0) if world.stretch is None else world.stretch
    content = {
        "parameters": learner.get_parameters(),
        "beside": {name: value.clone() for name, value in _weights_beside(learner).items()},
        "normalisation": state_of(seen) | returns | {STRETCH: torch.from_numpy(stretch).clone()},
        "counters": {name: int(getattr(learner, name)) for name in COUNTERS},
        "companions": {name: one.state() for name, one in companions_in(world).items()},
        "seconds": budget.seconds,
        "done": budget.done,
        "score": score,
        "basis": basis,
    }
    # Through memory: PyTorch's writer does not raise OSError on a full disk.
    written = io.BytesIO()
    torch.save(content, written)
    write_file(path, lambda file: file.write(written.getbuffer()))


def begin_with(path: Path, learner: Any, world: Normaliser) -> None:
    """Start a learner with the networks and the normalisation of another run's checkpoint.

    Counters, optimisers' rates and budget are those of a run that begins. What never changed there
    may change here: its variance begins with 1.

    Raises:
        ScenarioError: the checkpoint is missing, damaged or of other settings.
    """
    # A copy: networks load what they are given into the tensors of their state.
    companions = {name: deepcopy(one.state()) for name, one in companions_in(world).items()}
    counters = {name: getattr(learner, name) for name in COUNTERS}
    load_checkpoint(path, learner, world, Budget(None, 1))
    seen: Any = world.obs_rms
    seen.var = np.where(seen.var > LEAST_VARIANCE, seen.var, 1.0)
    for name, one in companions_in(world).items():
        one.restore(companions[name])
    for name, value in counters.items():
        setattr(learner, name, value)


def basis_in(path: Path) -> str:
    """Return what the score of a checkpoint was made by; of old ones "".

    Raises:
        ScenarioError: it is missing or damaged.
    """
    return str(_read(path).get("basis", ""))


def elapsed_in(path: Path, settings: Settings) -> Budget:
    """Return the budget of settings with what a checkpoint had spent.

    Raises:
        ScenarioError: it is missing or damaged.
    """
    content, budget = _read(path), Budget.of(settings)
    budget.spent_s, budget.done = float(content.get("seconds", 0.0)), int(content.get("done", 0))
    return budget


def _read(path: Path) -> dict[str, Any]:
    try:
        return dict(torch.load(path, weights_only=True))
    except FileNotFoundError as error:
        raise ScenarioError(
            f"{path}: no such checkpoint, as the run ended before its first evaluation; begin it "
            "again"
        ) from error
    except UnpicklingError as error:  # whose words tell how to run code that lies in the file
        raise ScenarioError(
            f"{path}: damaged, or no checkpoint: it holds other than numbers and names"
        ) from error
    except Exception as error:  # PyTorch's reader raises errors of many types on a damaged file
        raise _refusal(path, error) from error


def _refusal(path: Path, error: Exception) -> ScenarioError:
    """Return an error with the beginning of what PyTorch says, which takes up to a page."""
    words = " ".join(str(error).split())[:MOST_WORDS]
    return ScenarioError(f"{path}: damaged, or of other settings: {words}")


def load_checkpoint(path: Path, learner: Any, world: Normaliser, budget: Budget) -> float:
    """Restore a training from a checkpoint; return the score it was saved with.

    A judge that the checkpoint does not have, as the settings have changed, starts untrained.

    Raises:
        ScenarioError: the checkpoint is missing, damaged or of other settings.
    """
    content = _read(path)
    try:
        learner.set_parameters(content["parameters"], exact_match=True, device="cpu")
        beside = content.get("beside", {})
        for name, weight in _weights_beside(learner).items():
            if name in beside:
                weight.copy_(beside[name])  # in its place, where its optimiser knows it
        numbers = content["normalisation"]
        seen: Any = world.obs_rms
        restore_means(seen, numbers)
        restore_means(
            world.ret_rms, {name: numbers[RETURN + name] for name in state_of(world.ret_rms)}
        )
        stretch = numbers[STRETCH].numpy()
        world.stretch = stretch if stretch.size else None
        for name in COUNTERS:
            setattr(learner, name, content["counters"][name])
        known = content.get("companions", {})
        for name, one in companions_in(world).items():
            if name in known:
                one.restore(known[name])
        budget.spent_s, budget.done = float(content["seconds"]), int(content["done"])
        return float(content["score"])
    except Exception as error:  # shapes that do not fit fail in many ways
        raise _refusal(path, error) from error
