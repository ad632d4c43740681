"""Join two policies in one file, of which an observation says which one answers.

In a lot one drives to the slot, and the other one into it: what is learned of the way and what is
learned of its end disturb each other in one network, and the end is learned a hundred times as fast
by one that sees nothing else. On a track one drives by the scan, and the other one by the line once
the course is charted. The file is a policy as any other.
"""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import onnx
from onnx import helper

from race_agents.planning.line_view import UNKNOWN
from race_agents.policies.metadata import CHARTED, INPUT, OUTPUT, PolicyMetadata
from race_agents.policies.registry import policy_bytes
from race_agents.policies.session import Policy
from race_agents.training.onnx_graph import OnnxGraph, write_graph
from race_server.core.observation import PRESETS
from race_server.envs.actions import ACTIONS, WIDTHS
from race_server.errors import ScenarioError

DISTANCE = "goal_distance"  # the part of an observation that decides in a lot [m]
STEP = "line_step"  # and on a track [m]: 0 where there is no line
FAR, NEAR = "far_", "near_"  # in front of the names of what the first and the second one bring
# What the metadata of both have to say alike.
ALIKE = ("action", "vehicle", "decision_s", "base", "level")


def join_in_lot(path: Path, far: Path, near: Path, within: float) -> None:
    """Write a policy that answers as `near` up to a distance to the slot, and beyond as `far`.

    near: may see less than `far`; within: that distance [m].

    Raises:
        DriverError: a file is damaged or no policy.
        ScenarioError: they do not answer alike, or the second one sees what the first does not.
    """
    first, second = Policy(far).metadata, Policy(near).metadata
    _check(first, second, near)
    strange = [part for part in second.parts if part not in first.parts]
    if strange or DISTANCE not in first.parts:
        raise ScenarioError(
            f"{near} sees {strange[0] if strange else DISTANCE}, which the other policy does not "
            "see; let it learn from what both see"
        )
    lots = tuple(dict.fromkeys((*first.lots, *second.lots)))
    joined = replace(first, lots=lots)
    _join(path, {FAR: far, NEAR: near}, joined, (DISTANCE, within), (FAR, NEAR))


def join_by_chart(path: Path, scan: Path, line: Path) -> None:
    """Write a policy that answers as `scan` until its course is charted, and then as `line`.

    Raises:
        DriverError: a file is damaged or no policy.
        ScenarioError: they do not answer alike, the first one sees no lidar, or the second one no
            line.
    """
    first, second = Policy(scan).metadata, Policy(line).metadata
    _check(first, second, line)
    if first.lots:
        raise ScenarioError(
            f"{scan} parks: give --within too, the distance to the slot up to which {line} drives"
        )
    if "lidar" not in first.parts or not CHARTED.isdisjoint(first.parts):
        raise ScenarioError(
            f"{scan}: it has to race by a lidar, and without a line; choose another"
        )
    strange = [p for p in second.parts if p not in PRESETS["rivals"] or p in UNKNOWN]
    if strange or CHARTED.isdisjoint(second.parts):
        raise ScenarioError(
            f"{line}: it sees {strange[0] if strange else 'no line'}, and has to see the line by "
            "what a chart shows, as full does; choose another"
        )
    sizes = {**dict(zip(second.parts, second.sizes, strict=True)), STEP: 1}
    more = {part: size for part, size in sizes.items() if part not in first.parts}
    joined = replace(
        first,
        parts=(*first.parts, *more),
        sizes=(*first.sizes, *more.values()),
        tracks=tuple(dict.fromkeys((*first.tracks, *second.tracks))),
        charts=True,
    )
    _join(path, {FAR: scan, NEAR: line}, joined, (STEP, 0.0), (NEAR, FAR))


def _join(
    path: Path,
    files: Mapping[str, Path],
    joined: PolicyMetadata,
    decides: tuple[str, float],
    above_and_else: tuple[str, str],
) -> None:
    """Write a policy that answers as one of two files.

    files: by prefix; decides: a part, and a number; above_and_else: the prefix of the file that
    answers where the part is above the number, and that of the other one.
    """
    graph, places = OnnxGraph(), places_of(joined)
    answers = {}
    for prefix, file in files.items():
        parts, seen = Policy(file).metadata.parts, INPUT
        if parts != joined.parts:
            columns = np.concatenate([places[name] for name in parts])
            seen = graph.add("Gather", INPUT, columns, axis=1)
        answers[prefix] = _add(graph, file, prefix, seen)
    part, number = decides
    deciding = graph.add("Gather", INPUT, places[part], axis=1)
    above = graph.add("Greater", deciding, np.float32(number))
    graph.add("Where", above, *(answers[prefix] for prefix in above_and_else))
    write_graph(path, graph, joined, WIDTHS[ACTIONS[joined.action]])


def places_of(metadata: PolicyMetadata) -> dict[str, Any]:
    """Return the columns of an observation in which each part is."""
    ends = np.cumsum(metadata.sizes)
    return {
        part: np.arange(end - size, end)
        for part, size, end in zip(metadata.parts, metadata.sizes, ends, strict=True)
    }


def _check(first: PolicyMetadata, second: PolicyMetadata, path: Path) -> None:
    """Check that two policies act alike, and that parts that both see have one size."""
    for name in ALIKE:
        own, other = getattr(second, name), getattr(first, name)
        if own != other:
            raise ScenarioError(
                f"{path}: {name} = {own!r}, of the other policy {other!r}; join two that learned "
                "alike"
            )
    known = dict(zip(first.parts, first.sizes, strict=True))
    for part, size in zip(second.parts, second.sizes, strict=True):
        if known.get(part, size) != size:
            raise ScenarioError(
                f"{path} sees {size} numbers of {part}, the other policy {known[part]}; join two "
                "that learned alike"
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
