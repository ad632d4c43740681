"""A policy file of any torch module, and of an ONNX file from elsewhere."""

from pathlib import Path
from typing import Any

import numpy as np
import onnx
import pytest
import torch
from onnx import TensorProto, helper, numpy_helper
from torch import nn

from race_agents.policies.session import Policy
from race_agents.training.module_export import adopt_onnx, export_module, metadata_of_task
from race_server.core.driver import driver_named
from race_server.core.observation import layout_of
from race_server.envs.batch import Batch
from race_server.envs.presets import parking_task
from race_server.errors import DriverError, ScenarioError
from support.tasks import ring_task

TASK = ring_task(1, observation="radar")
SIZE = layout_of(TASK.observation, TASK.scenarios[0].lidar.rays).size


class Actor(nn.Module):
    """A network as people write them: normalised, with residual and gated layers."""

    def __init__(self, answers: int = 3) -> None:
        super().__init__()
        self.register_buffer("mean", torch.linspace(-1.0, 1.0, SIZE))
        self.register_buffer("deviation", torch.full((SIZE,), 2.0))
        self.first = nn.Sequential(nn.Linear(SIZE, 16), nn.LayerNorm(16), nn.SiLU(), nn.Dropout())
        self.second = nn.Sequential(nn.Linear(16, 16, bias=False), nn.ELU(), nn.LeakyReLU())
        self.last = nn.Linear(16, answers)

    def forward(self, seen: torch.Tensor) -> torch.Tensor:
        seen = torch.clamp((seen - self.mean) / self.deviation, -5.0, 5.0)
        hidden = self.first(seen)
        hidden = hidden + torch.sigmoid(self.second(hidden))
        return torch.tanh(self.last(hidden)) * 1.5


def test_a_module_becomes_a_policy_that_drives_and_answers_like_it(tmp_path: Path) -> None:
    torch.manual_seed(1)
    path, module = tmp_path / "mine.onnx", Actor()
    policy = export_module(path, module, TASK, "mine")
    batch = Batch(TASK, seed=3)
    seen = batch.observations[0].copy()
    with torch.no_grad():
        wanted = module(torch.as_tensor(seen)).clamp(torch.tensor([-1.0, -1.0, 0.0]), torch.ones(3))
    assert policy.decide(seen) == pytest.approx(wanted.numpy(), abs=1e-5)
    assert driver_named(f"learned:{path}").preset == "radar"
    assert policy.metadata.algorithm == "mine"


def test_a_module_in_double_precision_becomes_a_policy_and_stays_as_it_is(tmp_path: Path) -> None:
    torch.manual_seed(1)
    module = Actor().double()
    policy = export_module(tmp_path / "mine.onnx", module, TASK, "mine")
    assert module.last.weight.dtype == torch.float64
    seen = Batch(TASK, seed=3).observations[0].copy()
    again = export_module(tmp_path / "single.onnx", module.float(), TASK, "mine")
    assert policy.decide(seen) == pytest.approx(again.decide(seen))


def test_merits_of_discrete_actions_become_the_best_of_them(tmp_path: Path) -> None:
    task = ring_task(1, observation="radar", action="discrete")
    policy = export_module(tmp_path / "it.onnx", Actor(15), task)
    assert policy.decide(np.zeros((2, SIZE), np.float32)).shape == (2, 1)


@pytest.mark.parametrize("level", ["", "precise"])
def test_a_policy_that_parks_is_checked_at_the_level_that_it_learned(level: str) -> None:
    metadata = metadata_of_task(parking_task("zone-30", level=level), "mine")
    assert (metadata.lots, metadata.level) == (("zone-30",), level)


class Branching(nn.Module):
    def forward(self, seen: torch.Tensor) -> torch.Tensor:
        return seen if seen.sum() > 0 else -seen


class Sorting(nn.Module):
    def forward(self, seen: torch.Tensor) -> torch.Tensor:
        return torch.cumsum(seen, 1)


class Pair(nn.Module):
    def forward(self, seen: torch.Tensor) -> Any:
        return seen, seen


@pytest.mark.parametrize(
    ("module", "words"),
    [
        (Branching(), "cannot be traced"),
        (Sorting(), "calls cumsum, for which a policy file has no operator"),
        (Pair(), "let it answer the actions alone"),
        (nn.Linear(SIZE, 2), "do not fit|speak of|answers"),
        (nn.LSTM(SIZE, 3), "cannot be exported yet|cannot be traced|answer the actions alone"),
    ],
)
def test_a_module_that_no_file_can_hold_is_refused(
    module: nn.Module, words: str, tmp_path: Path
) -> None:
    with pytest.raises((ScenarioError, DriverError), match=words):
        export_module(tmp_path / "it.onnx", module, TASK)


def foreign_file(path: Path, operator: str = "Tanh") -> np.ndarray:
    """Write a file as other exporters do: own names, constants as operators, packed numbers."""
    weights = np.random.default_rng(1).normal(size=(SIZE, 3)).astype(np.float32)
    constant = numpy_helper.from_array(np.float32([0.5, 0.5, 0.5]), "value")
    nodes = [
        helper.make_node("Constant", [], ["half"], value=constant),
        helper.make_node("MatMul", ["obs", "w"], ["h"]),
        helper.make_node("Add", ["h", "half"], ["i"]),
        helper.make_node(operator, ["i"], ["mu"]),
    ]
    kept = helper.make_tensor("w", TensorProto.FLOAT, weights.shape, weights.ravel().tolist())
    ends = [
        helper.make_tensor_value_info(name, TensorProto.FLOAT, ["batch", columns])
        for name, columns in (("obs", SIZE), ("mu", 3))
    ]
    graph = helper.make_graph(nodes, "main", ends[:1], ends[1:], [kept])
    opset = helper.make_opsetid("", 17)
    onnx.save(helper.make_model(graph, ir_version=8, opset_imports=[opset]), str(path))
    return weights


def test_an_onnx_file_from_elsewhere_becomes_a_policy(tmp_path: Path) -> None:
    weights = foreign_file(tmp_path / "theirs.onnx")
    policy = adopt_onnx(tmp_path / "theirs.onnx", tmp_path / "ours.onnx", TASK)
    seen = np.ones((2, SIZE), np.float32)
    assert policy.decide(seen) == pytest.approx(np.tanh(seen @ weights + 0.5), abs=1e-5)


def adopted(path: Path, nodes: list[Any], answer: str, **more: Any) -> Policy:
    """Adopt a file of these operators, which take `obs` and the constant `w` of ones."""
    ends = [
        helper.make_tensor_value_info(name, TensorProto.FLOAT, ["batch", columns])
        for name, columns in (("obs", SIZE), (answer, 3), *more.pop("inputs", ()))
    ]
    kept = numpy_helper.from_array(np.ones((SIZE, 3), np.float32), "w")
    graph = helper.make_graph(nodes, "main", [ends[0], *ends[2:]], [ends[1]], [kept])
    opset = helper.make_opsetid("", 17)
    onnx.save(helper.make_model(graph, opset_imports=[opset], **{"ir_version": 8, **more}), path)
    return adopt_onnx(path, path.with_name("ours.onnx"), TASK)


def test_names_in_an_onnx_file_from_elsewhere_do_not_matter(tmp_path: Path) -> None:
    """Here `action` is not yet limited, and `observation` is normalised; and `w` is an input."""
    nodes = [
        helper.make_node("Constant", [], ["action_2"], value_float=10.0),
        helper.make_node("Div", ["obs", "action_2"], ["observation"]),
        helper.make_node("MatMul", ["observation", "w"], ["action"]),
        helper.make_node("Tanh", ["action"], ["limited"]),
    ]
    policy = adopted(tmp_path / "theirs.onnx", nodes, "limited", inputs=[("w", 3)])
    seen = np.ones((1, SIZE), np.float32)
    assert policy.decide(seen) == pytest.approx(np.full((1, 3), np.tanh(SIZE / 10.0)), abs=1e-5)


def test_an_onnx_file_that_is_not_valid_is_refused_in_a_sentence(tmp_path: Path) -> None:
    multiply = helper.make_node("MatMul", ["obs", "w"], ["h"])
    word = [helper.make_node("Constant", [], ["word"], value_string="x"), multiply]
    with pytest.raises(ScenarioError, match="a constant of it is no table"):
        adopted(tmp_path / "theirs.onnx", word, "h")
    with pytest.raises(ScenarioError, match="is not valid: Your model ir_version 99 is higher"):
        adopted(tmp_path / "theirs.onnx", [multiply], "h", ir_version=99)


def test_what_is_refused_leaves_the_file_that_was_there(tmp_path: Path) -> None:
    path = tmp_path / "it.onnx"
    export_module(path, Actor(), TASK)
    before = path.read_bytes()
    for answers in (4, 1):
        with pytest.raises((DriverError, ScenarioError)):
            export_module(path, Actor(answers), TASK)
    assert path.read_bytes() == before
    foreign_file(path, "Det")
    before = path.read_bytes()
    with pytest.raises((DriverError, ScenarioError), match="Det"):
        adopt_onnx(path, path, TASK)  # in its place
    assert path.read_bytes() == before


def test_a_batch_normalisation_is_that_of_what_it_has_learned(tmp_path: Path) -> None:
    layer = nn.BatchNorm1d(SIZE, momentum=None)
    layer(torch.randn(100, SIZE) * 3.0 + 200.0)
    module = nn.Sequential(layer, nn.Linear(SIZE, 3), nn.Tanh())
    seen = np.full((1, SIZE), 201.0, np.float32)
    found = export_module(tmp_path / "it.onnx", module, TASK).decide(seen)
    with torch.no_grad():
        assert found == pytest.approx(module(torch.as_tensor(seen)).numpy(), abs=1e-5)


def test_an_onnx_file_with_other_operators_is_refused_and_leaves_nothing(tmp_path: Path) -> None:
    foreign_file(tmp_path / "theirs.onnx", "Det")
    with pytest.raises((DriverError, ScenarioError), match="Det"):
        adopt_onnx(tmp_path / "theirs.onnx", tmp_path / "ours.onnx", TASK)
    assert not (tmp_path / "ours.onnx").exists()
    (tmp_path / "text.onnx").write_text("no")
    with pytest.raises(ScenarioError, match="is no ONNX file"):
        adopt_onnx(tmp_path / "text.onnx", tmp_path / "ours.onnx", TASK)
