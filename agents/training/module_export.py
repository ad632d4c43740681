"""Make a policy file of any torch module, or of an ONNX file that another program wrote.

What comes out is checked as every policy is: it holds operators of one list only, see
`race_agents.policies.network`, and answers as what it was made of.
"""

import operator
from collections.abc import Callable
from copy import deepcopy
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import torch
from gymnasium import spaces
from onnx import helper, numpy_helper
from torch import fx, nn
from torch.nn import functional

from race_agents.policies.metadata import INPUT, OUTPUT, PolicyMetadata
from race_agents.policies.session import Policy
from race_agents.training.onnx_graph import OnnxGraph, model_of, policy_of
from race_server.core.clock import TICK_S
from race_server.core.observation import PARTS, layout_of
from race_server.envs.spaces import action_space
from race_server.envs.task import Task
from race_server.errors import ScenarioError
from race_server.kept_file import write_file
from race_server.scenario.level import name_of_level
from race_server.scenario.race import Scenario, is_lot
from race_server.version import __version__

COMPARED = 64  # observations on which the file and the module are compared
MOST_WORDS = 200  # characters of an error of ONNX
MOST_DIFFERENCE = 1e-4  # as a share of the answer, above 1: rounding in single precision


def metadata_of_task(task: Task, algorithm: str) -> PolicyMetadata:
    """Return the metadata of a policy that learned a task. algorithm: a word on how."""
    scenario = task.scenarios[0]
    layout = layout_of(task.observation, scenario.lidar.rays)
    names = [PARTS[number].name for number in layout.numbers]
    courses = tuple(dict.fromkeys(one.course.name for one in task.scenarios))
    parks = is_lot(scenario.course)
    return PolicyMetadata(
        parts=tuple(names),
        sizes=tuple(layout.slices[name].stop - layout.slices[name].start for name in names),
        action=task.action,
        vehicle=scenario.vehicle_of(0).name,
        lidar_rays=scenario.lidar.rays if {"lidar", "lidar_before"} & set(names) else 0,
        lidar_field=scenario.lidar.field,
        lidar_reach=scenario.lidar.reach,
        decision_s=task.decision_ticks * TICK_S,
        algorithm=algorithm,
        tracks=() if parks else courses,
        lots=courses if parks else (),
        level=_level_of(scenario),
        seed=0,
        settings="",
        simulator=__version__,
        base=task.base,
    )


def _level_of(scenario: Scenario) -> str:
    """Return the name of the level of a scenario, if it is not that of its lot."""
    name, lot = name_of_level(scenario.level), scenario.course.lot
    return "" if lot is None or name == lot.level else name


def export_module(path: Path, module: nn.Module, task: Task, algorithm: str = "other") -> Policy:
    """Write a torch module as a policy file, and return the policy.

    module: from observations (n, size), as the task gives them, to actions (n, A); for discrete
    actions to the merit of each, (n, 15). What comes before and after its network, such as a
    normalisation, belongs into it.

    Raises:
        ScenarioError: it does something that a policy file has no operator for, or the file
            answers otherwise than it.
    """
    metadata = metadata_of_task(task, algorithm)
    # A file is in single precision; that of the module stays as it is.
    module = deepcopy(module.eval()).to("cpu", torch.float32)
    graph = OnnxGraph()
    try:
        traced = fx.symbolic_trace(nn.Sequential(module))
    except Exception as error:  # whatever code in a module trips over when it is traced
        raise ScenarioError(
            f"{type(module).__name__} cannot be traced: {error}; its `forward` may not depend on "
            "the numbers that it is given"
        ) from error
    _Writer(traced, graph).write()
    width = _limit(graph, task)
    data = policy_of(model_of(graph, metadata, width), metadata)
    # A file of that name stays as it is, until this one is known to be good.
    policy = Policy(path, data)
    _compare(policy, lambda rows: _answers_of(module, rows, task))
    write_file(path, lambda file: file.write(data))
    return policy


def adopt_onnx(source: Path, path: Path, task: Task, algorithm: str = "other") -> Policy:
    """Write an ONNX file of another program as a policy file, and return the policy.

    source: takes one table of observations, and its first answer is one of actions, limited as the
    task's; names do not matter.

    Raises:
        ScenarioError: it is no ONNX file.
        DriverError: it holds something that a policy file may not hold.
    """
    try:
        model = onnx.load(str(source))
    except Exception as error:  # protobuf's errors, and those of the disk
        raise ScenarioError(f"{source} is no ONNX file: {error}") from error
    metadata, body = metadata_of_task(task, algorithm), model.graph
    try:
        _inline_constants(body)
    except Exception as error:  # texts, sparse tables, damage: each fails in another way
        raise ScenarioError(f"{source}: a constant of it is no table: {error}") from error
    taken = _inputs_of(body)
    if len(taken) != 1 or not body.output:
        raise ScenarioError(
            f"{source} takes {', '.join(taken) or 'nothing'}: a policy takes one table"
        )
    _rename(body, {taken[0]: INPUT, body.output[0].name: OUTPUT})
    space = action_space(task.action)
    width = 1 if isinstance(space, spaces.Discrete) else int(np.prod(space.shape or (1,)))
    for ends, name, columns in ((body.input, INPUT, metadata.size), (body.output, OUTPUT, width)):
        del ends[:]
        kind = onnx.TensorProto.FLOAT
        ends.append(helper.make_tensor_value_info(name, kind, ["n", columns]))
    del body.value_info[:]
    try:
        data = policy_of(model, metadata)
    except onnx.checker.ValidationError as error:
        words = " ".join(str(error).split())[:MOST_WORDS]
        raise ScenarioError(f"{source} is not valid: {words}") from error
    policy = Policy(path, data)
    write_file(path, lambda file: file.write(data))
    return policy


def _inputs_of(body: Any) -> list[str]:
    """Return the names of what a graph takes; older files name their constants there as well."""
    constants = {constant.name for constant in body.initializer}
    return [one.name for one in body.input if one.name not in constants]


def _inline_constants(body: Any) -> None:
    """Turn operators that only answer a constant into constants, in the one form we read."""
    for node in [node for node in body.node if node.op_type == "Constant"]:
        body.initializer.append(_constant_of(node))
        body.node.remove(node)
    for number, constant in enumerate(list(body.initializer)):
        value = numpy_helper.to_array(constant)
        body.initializer[number].CopyFrom(numpy_helper.from_array(value, constant.name))


def _constant_of(node: Any) -> Any:
    """Return what an operator `Constant` answers: a tensor, one number, or several."""
    value = helper.get_attribute_value(node.attribute[0])
    if isinstance(value, onnx.TensorProto):
        value = numpy_helper.to_array(value)
    elif node.attribute[0].name in {"value_float", "value_floats"}:
        value = np.asarray(value, np.float32)
    return numpy_helper.from_array(np.asarray(value), node.output[0])


def _rename(body: Any, names: dict[str, str]) -> None:
    """Rename values; others that have the new names give way."""
    taken = (*body.node, *body.initializer)
    known = {name for one in taken for name in _names_of(one)} | set(names)
    clear = {name: _free(name, known) for name in names.values() if name in known}
    renamed = clear | names
    for constant in body.initializer:
        constant.name = renamed.get(constant.name, constant.name)
    for node in body.node:
        for ends in (node.input, node.output):
            for place, name in enumerate(ends):
                ends[place] = renamed.get(name, name)


def _names_of(one: Any) -> tuple[str, ...]:
    return (*one.input, *one.output) if isinstance(one, onnx.NodeProto) else (one.name,)


def _free(name: str, known: set[str]) -> str:
    return next(free for n in count(2) if (free := f"{name}_{n}") not in known)


def _limit(graph: OnnxGraph, task: Task) -> int:
    """Add what the task's actions are limited to; return how many numbers an answer has."""
    space = action_space(task.action)
    if isinstance(space, spaces.Discrete):
        graph.then("ArgMax", axis=1, keepdims=1)
        graph.then("Cast", to=onnx.TensorProto.FLOAT)
        return 1
    assert isinstance(space, spaces.Box)
    graph.then("Max", space.low.astype(np.float32))
    graph.then("Min", space.high.astype(np.float32))
    return len(space.low)


def _answers_of(module: nn.Module, rows: Any, task: Task) -> Any:
    with torch.no_grad():
        answers = module(torch.as_tensor(rows)).numpy()
    space = action_space(task.action)
    if isinstance(space, spaces.Box):
        return np.clip(answers, space.low, space.high)
    return answers.argmax(axis=1)[:, None].astype(np.float32)


def _compare(policy: Policy, answers: Callable[[Any], Any]) -> None:
    chance = np.random.default_rng(0)
    rows = chance.normal(0.0, 2.0, (COMPARED, policy.metadata.size)).astype(np.float32)
    own, found = answers(rows), policy.decide(rows)
    if own.shape != found.shape or np.abs(own - found).max() > MOST_DIFFERENCE:
        raise ScenarioError(
            f"the module answers {own.shape}, the file {found.shape}, and not alike: give a module "
            "from observations (n, size) to actions (n, A)"
        )


# Functions and methods that are one operator, with no further numbers.
_PLAIN = {
    **dict.fromkeys((torch.tanh, functional.tanh, "tanh"), "Tanh"),
    **dict.fromkeys((torch.relu, functional.relu, "relu"), "Relu"),
    **dict.fromkeys((torch.sigmoid, functional.sigmoid, "sigmoid"), "Sigmoid"),
    **dict.fromkeys((torch.exp, "exp"), "Exp"),
    **dict.fromkeys((torch.sqrt, "sqrt"), "Sqrt"),
    **dict.fromkeys((torch.log, "log"), "Log"),
    **dict.fromkeys((operator.add, torch.add, "add"), "Add"),
    **dict.fromkeys((operator.sub, torch.sub, "sub"), "Sub"),
    **dict.fromkeys((operator.mul, torch.mul, "mul"), "Mul"),
    **dict.fromkeys((operator.truediv, torch.div, "div"), "Div"),
}
_NOTHING = (nn.Identity, nn.Dropout, nn.Flatten)


class _Writer:
    """Writes a traced module, operation by operation."""

    def __init__(self, traced: fx.GraphModule, graph: OnnxGraph) -> None:
        self.traced, self.graph = traced, graph
        self.values: dict[fx.Node, Any] = {}  # names of tables, or constants

    def write(self) -> None:
        for node in self.traced.graph.nodes:
            if node.op == "placeholder":
                self.values[node] = INPUT
            elif node.op == "get_attr":
                value: Any = self.traced
                for name in str(node.target).split("."):
                    value = getattr(value, name)
                self.values[node] = _numbers_of(value)
            elif node.op == "call_module":
                layer = self.traced.get_submodule(str(node.target))
                self.values[node] = self._layer(layer, self._taken(node.args[0]))
            elif node.op == "output":
                self.graph.end = self._answer(node.args[0])
            else:
                self.values[node] = self._function(node)

    def _answer(self, given: Any) -> str:
        if not isinstance(given, fx.Node) or not isinstance(self.values.get(given), str):
            raise ScenarioError(f"the module answers {given}: let it answer the actions alone")
        return str(self.values[given])

    def _taken(self, given: Any) -> Any:
        if isinstance(given, fx.Node):
            return self.values[given]
        if isinstance(given, int | float):
            return np.float32(given)
        raise ScenarioError(f"the module calculates with {given!r}: only tables and numbers fit")

    def _function(self, node: fx.Node) -> Any:
        target: Any = node.target
        if target in _PLAIN and not node.kwargs:
            return self.graph.add(_PLAIN[target], *[self._taken(one) for one in node.args])
        if target in (torch.clamp, "clamp"):
            low, high = _limits_of(node)
            end = self._taken(node.args[0])
            return self.graph.add("Clip", end, np.float32(low), np.float32(high))
        raise ScenarioError(
            f"the module calls {getattr(target, '__name__', target)}, for which a policy file has "
            "no operator"
        )

    def _layer(self, layer: nn.Module, end: Any) -> Any:
        add = self.graph.add
        if isinstance(layer, nn.Linear):
            bias = [] if layer.bias is None else [_numbers_of(layer.bias)]
            return add("Gemm", end, _numbers_of(layer.weight), *bias, transB=1)
        if isinstance(layer, nn.LayerNorm):
            return self._normalised(layer, end)
        if isinstance(layer, nn.BatchNorm1d) and layer.running_var is not None:
            return self._standardised(layer, end)
        if isinstance(layer, nn.SiLU):
            return add("Mul", end, add("Sigmoid", end))
        if isinstance(layer, nn.ELU | nn.LeakyReLU):
            is_elu = isinstance(layer, nn.ELU)
            alpha = float(layer.alpha if isinstance(layer, nn.ELU) else layer.negative_slope)
            return add("Elu" if is_elu else "LeakyRelu", end, alpha=alpha)
        if isinstance(layer, nn.Hardtanh):
            return add("Clip", end, np.float32(layer.min_val), np.float32(layer.max_val))
        if isinstance(layer, _NOTHING):
            return end
        for kind, name in ((nn.Tanh, "Tanh"), (nn.ReLU, "Relu"), (nn.Sigmoid, "Sigmoid")):
            if isinstance(layer, kind):
                return add(name, end)
        if isinstance(layer, nn.Softplus) and (layer.beta, layer.threshold) == (1.0, 20.0):
            return add("Softplus", end)
        raise ScenarioError(f"a layer {type(layer).__name__} cannot be exported yet")

    def _normalised(self, layer: nn.LayerNorm, end: Any) -> Any:
        add, size = self.graph.add, layer.normalized_shape[-1]
        share = np.full((size, 1), 1.0 / size, np.float32)
        off = add("Sub", end, add("MatMul", end, share))
        variance = add("MatMul", add("Mul", off, off), share)
        spread = add("Sqrt", add("Add", variance, np.float32(layer.eps)))
        return self._stretched(layer, add("Div", off, spread))

    def _standardised(self, layer: Any, end: Any) -> Any:
        """Add what a batch normalisation does with the means that it has learned."""
        spread = torch.sqrt(layer.running_var + layer.eps)
        off = self.graph.add("Sub", end, _numbers_of(layer.running_mean))
        return self._stretched(layer, self.graph.add("Div", off, _numbers_of(spread)))

    def _stretched(self, layer: Any, end: Any) -> Any:
        for name, numbers in (("Mul", layer.weight), ("Add", layer.bias)):
            end = end if numbers is None else self.graph.add(name, end, _numbers_of(numbers))
        return end


def _limits_of(node: fx.Node) -> tuple[float, float]:
    given = dict(zip(("min", "max"), node.args[1:], strict=False)) | node.kwargs
    numbers = [given.get("min", -np.inf), given.get("max", np.inf)]
    if not all(isinstance(number, int | float) for number in numbers):
        raise ScenarioError("the module clamps to what is no number: give it two")
    low, high = (float(number) for number in numbers)  # type: ignore[arg-type]  # just checked
    return low, high


def _numbers_of(value: torch.Tensor) -> Any:
    return value.detach().to(torch.float32).numpy()
