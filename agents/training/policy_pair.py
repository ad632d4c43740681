"""Join two policies of a lot in one file: one drives to the slot, the other one into it.

What is learned of the way and what is learned of its end disturb each other in one network, and the
end is learned a hundred times as fast by one that sees nothing else. Which of them answers depends
on the observation alone, so the file is a policy as any other.
"""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import onnx
from onnx import helper

from race_agents.policies.metadata import INPUT, OUTPUT, PolicyMetadata
from race_agents.policies.registry import policy_bytes
from race_agents.policies.session import Policy
from race_agents.training.onnx_graph import OnnxGraph, write_graph
from race_server.envs.actions import ACTIONS, WIDTHS
from race_server.errors import ScenarioError

DISTANCE = "goal_distance"  # the part of an observation that decides [m]
FAR, NEAR = "far_", "near_"  # in front of the names of what each brings
# What the metadata of both have to say alike.
ALIKE = ("action", "vehicle", "decision_s", "base", "level")


def join_policies(path: Path, far: Path, near: Path, within: float) -> None:
    """Write a policy that answers as `near` up to a distance to the slot, and beyond as `far`.

    near: may see less than `far`; within: that distance [m].

    Raises:
        DriverError: a file is damaged or no policy.
        ScenarioError: they do not answer alike, or the second one sees what the first does not.
    """
    first, second = Policy(far).metadata, Policy(near).metadata
    _check(first, second, near)
    graph = OnnxGraph()
    places = places_of(first)
    seen = np.concatenate([places[part] for part in second.parts])
    answers = (
        _add(graph, far, FAR, INPUT),
        _add(graph, near, NEAR, graph.add("Gather", INPUT, seen, axis=1)),
    )
    distance = graph.add("Gather", INPUT, places[DISTANCE], axis=1)
    graph.add("Where", graph.add("Greater", distance, np.float32(within)), *answers)
    lots = tuple(dict.fromkeys((*first.lots, *second.lots)))
    write_graph(path, graph, replace(first, lots=lots), WIDTHS[ACTIONS[first.action]])


def places_of(metadata: PolicyMetadata) -> dict[str, Any]:
    """Return the columns of an observation in which each part is."""
    ends = np.cumsum(metadata.sizes)
    return {
        part: np.arange(end - size, end)
        for part, size, end in zip(metadata.parts, metadata.sizes, ends, strict=True)
    }


def _check(first: PolicyMetadata, second: PolicyMetadata, near: Path) -> None:
    for name in ALIKE:
        own, other = getattr(second, name), getattr(first, name)
        if own != other:
            raise ScenarioError(
                f"{near}: {name} = {own!r}, of the other policy {other!r}; join two that learned "
                "alike"
            )
    known = dict(zip(first.parts, first.sizes, strict=True))
    strange = [
        part
        for part, size in zip(second.parts, second.sizes, strict=True)
        if known.get(part) != size
    ]
    if strange or DISTANCE not in known:
        raise ScenarioError(
            f"{near} sees {strange[0] if strange else DISTANCE}, which the other policy does not "
            "see; let it learn from what both see"
        )


def _add(graph: OnnxGraph, path: Path, prefix: str, seen: str) -> str:
    """Add the operators of a file, a prefix before their names; return that of its answer.

    seen: the name of what they take as observation.
    """
    body: Any = onnx.load_model_from_string(policy_bytes(path)).graph
    for constant in body.initializer:
        constant.name = prefix + constant.name
        graph.constants.append(constant)
    for node in body.node:
        names = [seen if name == INPUT else prefix + name for name in node.input]
        renamed = helper.make_node(node.op_type, names, [prefix + node.output[0]])
        renamed.attribute.extend(node.attribute)
        graph.nodes.append(renamed)
    return prefix + OUTPUT
