"""Start a learner with the network of a policy file: a bundled policy needs no run."""

from pathlib import Path
from typing import Any

import numpy as np
import onnx
import torch
from numpy.typing import NDArray
from onnx import numpy_helper
from stable_baselines3 import PPO

from race_agents.policies.session import Policy
from race_agents.policies.verification import MOST_DIFFERENCE
from race_agents.training.export import difference
from race_agents.training.imitation import FIRM, show_the_critic
from race_agents.training.normaliser import Normaliser
from race_agents.training.policy_pair import DISTANCE, NEAR, STEP, places_of
from race_server.errors import ScenarioError

COMPARED = 64  # observations on which the file and the learner have to answer alike
AWAY = 1000.0  # [m] from the slot in these, where there is one

_OTHER = (
    "the training has another network, observation, action, lidar or logarithms than this file, or "
    "does not learn by ppo; make them agree, or leave warm_start.policy out"
)

Constants = list[NDArray[Any]]


def begin_with_policy(path: Path, learner: Any, world: Normaliser) -> None:
    """Give a learner the actor and the normalisation of a policy file.

    What is normalised stays as it is in the file. The critic starts with the actor's layers and a
    value of zero. Of two policies that are joined it takes the first one.

    Raises:
        DriverError: the file is damaged or no policy.
        ScenarioError: it is of another network, observation, action or view than the learner.
    """
    policy = Policy(path)  # refuses files that hold anything but a network
    found = _constants_in(path)
    try:
        _take_layers(learner, found["Gemm"])
        _take_normalisation(world, found)
        size = policy.metadata.size
        seen = np.random.default_rng(0).normal(size=(COMPARED, size)).astype(np.float32)
        places = places_of(policy.metadata)
        seen[:, places.get(DISTANCE, [])] = AWAY
        if policy.metadata.charts:
            seen[:, places[STEP]] = 0.0
        off = difference(policy, learner, world, seen)
    except Exception as error:  # layers of other shapes fail in many ways
        raise ScenarioError(f"{path}: {_OTHER}") from error
    if off > MOST_DIFFERENCE:
        raise ScenarioError(f"{path}: {_OTHER}")
    show_the_critic(learner.policy)


def _constants_in(path: Path) -> dict[str, list[Constants]]:
    """Return the constants that operators of a file take, by operator, in its order."""
    graph = onnx.load_model_from_string(path.read_bytes()).graph
    known = {one.name: numpy_helper.to_array(one).copy() for one in graph.initializer}
    found: dict[str, list[Constants]] = {}
    for node in graph.node:
        constants = [known[name] for name in node.input if name in known]
        if constants and NEAR not in node.output[0]:
            found.setdefault(node.op_type, []).append(constants)
    return found


def _take_layers(learner: Any, layers: list[Constants]) -> None:
    assert isinstance(learner, PPO)
    policy: Any = learner.policy
    own = [*policy.mlp_extractor.policy_net, policy.action_net]
    linear = [layer for layer in own if isinstance(layer, torch.nn.Linear)]
    for layer, (weight, bias) in zip(linear, layers, strict=True):
        layer.load_state_dict({"weight": torch.from_numpy(weight), "bias": torch.from_numpy(bias)})


def _take_normalisation(world: Normaliser, found: dict[str, list[Constants]]) -> None:
    """Fill means and variances; a variance of 1 stands for what never changed there."""
    seen: Any = world.obs_rms
    ((mean,), *_), ((spread,), *_) = found["Sub"], found["Div"]
    seen.mean, seen.var, seen.count = mean, spread**2 - world.epsilon, FIRM
    # The only constant that is cast is the one that decorrelates, see `export.py`.
    world.stretch = found["Cast"][0][0].astype(np.float64) if "Cast" in found else None
