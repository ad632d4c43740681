"""Export a policy as one ONNX file: normalisation, network, action limits and metadata.

The graph is written layer by layer, so that the file depends on nothing but ONNX itself.
"""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import torch
from gymnasium import spaces
from numpy.typing import NDArray
from onnx import TensorProto
from stable_baselines3 import DQN, PPO, SAC, TD3

from race_agents.policies.metadata import PolicyMetadata
from race_agents.policies.session import Policy
from race_agents.training.normaliser import Normaliser
from race_agents.training.onnx_graph import OnnxGraph, write_graph
from race_agents.training.reward_wrapper import width_of
from race_agents.training.settings import Settings
from race_agents.training.settings_toml import digest_of
from race_agents.training.view import NEAREST, ObservationView
from race_server.core.observation import PARTS, layout_of
from race_server.errors import ScenarioError
from race_server.scenario.sensors import Lidar
from race_server.version import __version__


def export_policy(path: Path, learner: Any, world: Normaliser, metadata: PolicyMetadata) -> None:
    """Write the actor of a learner as an ONNX file.

    Raises:
        ScenarioError: the network has a layer that cannot be written.
    """
    graph = OnnxGraph()
    _normalise(graph, world)
    width = _act(graph, learner, world.action_space)
    write_graph(path, graph, metadata, width)


def _normalise(graph: OnnxGraph, world: Normaliser) -> None:
    """Add what `Normaliser` does, in double precision as there."""
    numbers: Any = world.obs_rms
    _view(graph, world.view, len(numbers.mean))
    graph.then("Sub", np.asarray(numbers.mean, np.float64))
    graph.then("Div", world.spread_of(numbers))
    most = np.float64(world.clip_obs)
    graph.then("Clip", -most, most)
    if world.stretch is not None:
        # It takes most of the file's bytes, and supervised steps use single precision, too.
        stretch = graph.add("Cast", world.stretch.astype(np.float32), to=TensorProto.DOUBLE)
        graph.then("MatMul", stretch)
    graph.then("Cast", to=TensorProto.FLOAT)


def _view(graph: OnnxGraph, view: ObservationView, size: int) -> None:
    """Add what `ObservationView` does; the end is in double precision then."""
    if np.isfinite(view.horizon):
        graph.then("Clip", -view.horizon, view.horizon)
    graph.then("Cast", to=TensorProto.DOUBLE)
    if len(view.ranges):
        _view_ranges(graph, view, size)
    if len(view.offsets):
        _view_offsets(graph, view, size)


def _view_offsets(graph: OnnxGraph, view: ObservationView, size: int) -> None:
    """Add sign · log(1 + |metres|) of offsets, as log(1 + ahead) - log(1 + back)."""
    metres, nothing, one = graph.end, np.float64(0.0), np.float64(1.0)
    sides = [
        graph.add("Log", graph.add("Add", graph.add("Max", way, nothing), one))
        for way in (metres, graph.add("Mul", metres, np.float64(-1.0)))
    ]
    short = graph.add("Sub", *sides)
    graph.end = graph.add("Where", np.isin(np.arange(size), view.offsets), short, metres)


def _view_ranges(graph: OnnxGraph, view: ObservationView, size: int) -> None:
    """Add logarithms of ranges, the gaps in them filled."""
    seen, nothing = graph.end, np.float64(0.0)
    reach = np.full(size, NEAREST)
    reach[view.ranges] = view.reach
    sides = []
    for places in (view.right, view.left):
        side = np.arange(size)
        side[view.ranges] = places
        sides.append(graph.add("Gather", seen, side, axis=1))
    near = graph.add("Max", *sides)
    filled = graph.add("Where", graph.add("Greater", seen, nothing), seen, near)
    filled = graph.add("Where", graph.add("Greater", filled, nothing), filled, reach)
    limited = graph.add("Min", graph.add("Max", filled, np.float64(NEAREST)), reach)
    logarithm = graph.add("Log", limited)
    graph.end = graph.add("Where", np.isin(np.arange(size), view.ranges), logarithm, seen)


def _act(graph: OnnxGraph, learner: Any, space: spaces.Space[Any]) -> int:
    """Add the actor and the scaling of its answer; return the number of its columns."""
    if isinstance(learner, PPO):
        _layers(graph, [*learner.policy.mlp_extractor.policy_net, learner.policy.action_net])
    elif isinstance(learner, SAC):
        _layers(graph, [*learner.actor.latent_pi, learner.actor.mu, torch.nn.Tanh()])
    elif isinstance(learner, TD3):
        _layers(graph, learner.actor.mu)
    elif isinstance(learner, DQN):
        _layers(graph, learner.q_net.q_net)
    if isinstance(space, spaces.Discrete):
        graph.then("ArgMax", axis=1, keepdims=1)
        graph.then("Cast", to=TensorProto.FLOAT)
        return 1
    if not isinstance(space, spaces.Box):
        raise ScenarioError(f"{space} cannot be exported: choose a discrete or continuous action")
    low, high = space.low.astype(np.float32), space.high.astype(np.float32)
    if isinstance(learner, SAC | TD3):
        # From [-1, 1] to the limits of each number.
        graph.then("Add", np.float32(1.0))
        graph.then("Mul", np.float32(0.5) * (high - low))
        graph.then("Add", low)
    graph.then("Max", low)
    graph.then("Min", high)
    return len(low)


def _layers(graph: OnnxGraph, layers: Iterable[torch.nn.Module]) -> None:
    for layer in layers:
        if isinstance(layer, torch.nn.Linear):
            weight, bias = (part.detach().numpy() for part in (layer.weight, layer.bias))
            graph.then("Gemm", weight, bias, transB=1)
        elif isinstance(layer, torch.nn.Tanh | torch.nn.ReLU):
            graph.then("Tanh" if isinstance(layer, torch.nn.Tanh) else "Relu")
        elif isinstance(layer, torch.nn.Sequential):
            _layers(graph, layer)
        elif isinstance(layer, torch.nn.Hardtanh):  # around SAC's answer, with `use_sde`
            graph.then("Clip", np.float32(layer.min_val), np.float32(layer.max_val))
        elif not isinstance(layer, torch.nn.Flatten | torch.nn.Identity):
            raise ScenarioError(f"a layer {type(layer).__name__} cannot be exported yet")


def metadata_from(settings: Settings, courses: tuple[str, ...]) -> PolicyMetadata:
    """Return the metadata of the policy of a training. courses: that it learned on."""
    layout = layout_of(settings.observation, settings.lidar.rays)
    names = [PARTS[number].name for number in layout.numbers]
    sees_lidar = bool({"lidar", "lidar_before"} & set(names))
    return PolicyMetadata(
        parts=tuple(names),
        sizes=tuple(layout.slices[name].stop - layout.slices[name].start for name in names),
        action=settings.action,
        vehicle=settings.vehicle,
        more_vehicles=settings.more_vehicles,
        lidar_rays=settings.lidar.rays if sees_lidar else 0,
        lidar_field=Lidar().field,
        lidar_reach=Lidar().reach,
        decision_s=settings.decision_s,
        algorithm=settings.algorithm.name,
        tracks=() if settings.parks else courses,
        lots=courses if settings.parks else (),
        level=settings.parking.level,
        seed=settings.seed,
        settings=digest_of(settings),
        simulator=__version__,
        base=settings.base,
        scan_limit=settings.scan_limit or 0.0,
        evades=bool(settings.evades),
    )


def difference(policy: Policy, learner: Any, world: Normaliser, seen: NDArray[Any]) -> float:
    """Return the largest difference between the answers of a file and of its learner.

    A learner sees the first numbers of what a file sees to which another one was joined.

    For discrete actions: how much less the learner values the file's choice than its own, as
    rounding alone decides between two of equal value.
    """
    size = width_of(world.observation_space)
    rows, answers = world.normalize_obs(seen[:, :size]), policy.decide(seen)
    if isinstance(world.action_space, spaces.Discrete):
        return _lost(_merits(learner, torch.as_tensor(rows)), torch.as_tensor(answers).long())
    own = learner.predict(rows, deterministic=True)[0]
    return float(np.abs(answers - np.reshape(own, (len(seen), -1))).max())


def _merits(learner: Any, rows: torch.Tensor) -> torch.Tensor:
    """Return the value of each answer to a learner, shape (n, answers)."""
    with torch.no_grad():
        if isinstance(learner, DQN):
            return torch.as_tensor(learner.q_net(rows))
        return torch.as_tensor(learner.policy.get_distribution(rows).distribution.logits)


def _lost(merits: torch.Tensor, answers: torch.Tensor) -> float:
    """Return how much worse answers (n, 1) are at most than the best, as a share above 1."""
    if int(answers.min()) < 0 or int(answers.max()) >= merits.shape[1]:
        return float("inf")
    best = merits.max(dim=1, keepdim=True).values
    return float(((best - merits.gather(1, answers)) / best.abs().clamp(min=1.0)).max())
