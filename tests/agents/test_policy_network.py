"""What a policy file may hold: all else is refused before ONNX Runtime sees it."""

import random
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import onnxruntime
import pytest
from onnx import TensorProto, helper, numpy_helper

from race_agents.policies.network import MOST_NUMBERS, network_in
from race_agents.policies.registry import SHIPPED
from race_agents.policies.session import Policy
from race_server.errors import DriverError

POLICY = SHIPPED / "time-trial-any.onnx"
BYTES = POLICY.read_bytes()


def end_with(model: Any, *nodes: Any, **constants: Any) -> None:
    """Add operators before the last; the last of them answers `more`, which is added to it."""
    body = model.graph
    for name, value in constants.items():
        body.initializer.append(numpy_helper.from_array(np.asarray(value), name))
    body.node[-1].output[0] = "almost"
    body.node.extend([*nodes, helper.make_node("Add", ["almost", "more"], ["action"])])


def name_another_file(model: Any) -> None:
    weights = model.graph.initializer[-1]
    weights.ClearField("raw_data")
    weights.data_location = TensorProto.EXTERNAL
    weights.external_data.add(key="location", value="../../secret")


def repeat_for_ever(model: Any) -> None:
    numbers = {kind: helper.make_tensor_value_info(kind, TensorProto.INT64, []) for kind in "iab"}
    goes_on = [helper.make_tensor_value_info(name, TensorProto.BOOL, []) for name in ("c", "d")]
    body = helper.make_graph(
        [helper.make_node("Identity", ["c"], ["d"]), helper.make_node("Identity", ["a"], ["b"])],
        "body",
        [numbers["i"], goes_on[0], numbers["a"]],
        [goes_on[1], numbers["b"]],
    )
    node = helper.make_node("Loop", ["often", "yes", "zero"], ["more"], body=body)
    end_with(model, node, often=np.int64(2**62), yes=np.True_, zero=np.int64(0))


def make_six_gigabytes(model: Any) -> None:
    end_with(
        model,
        helper.make_node("ConstantOfShape", ["shape"], ["huge"]),
        helper.make_node("ReduceSum", ["huge"], ["more"]),
        shape=np.array([1_500_000_000]),
    )


def multiply_row_by_column(model: Any) -> None:
    column, row = np.ones((40_000, 1), np.float32), np.ones((1, 40_000), np.float32)
    end_with(model, helper.make_node("Mul", ["column", "row"], ["more"]), column=column, row=row)


def widen_again_and_again(model: Any) -> None:
    nodes = [
        helper.make_node("Gather", ["observation", "places"], [f"wide{n}"], axis=1)
        for n in range(30)
    ]
    nodes.append(helper.make_node("ArgMax", ["wide0"], ["more"], axis=1))
    end_with(model, *nodes, places=np.zeros(10_000, np.int64))


def cast_a_constant_many_times(model: Any) -> None:
    nodes = [
        helper.make_node("Cast", ["row"], [f"cast{n}"], to=TensorProto.DOUBLE) for n in range(170)
    ]
    end_with(model, *nodes, row=np.ones((1, 100_000), np.float32))


def multiply_too_much(model: Any) -> None:
    nodes = [helper.make_node("MatMul", ["observation", "wide"], ["w0"])]
    nodes += [helper.make_node("Gemm", [f"w{n}", "square"], [f"w{n + 1}"]) for n in range(17)]
    square = np.ones((1000, 1000), np.float32)
    end_with(model, *nodes, square=square, wide=np.ones((104, 1000), np.float32))


def use_another_domain(model: Any) -> None:
    model.opset_import.append(helper.make_opsetid("com.microsoft", 1))
    model.graph.node[-1].domain = "com.microsoft"


def bring_a_function(model: Any) -> None:
    node = helper.make_node("Identity", ["x"], ["y"])
    model.functions.append(helper.make_function("own", "F", ["x"], ["y"], [node], []))


def hold_a_sparse_constant(model: Any) -> None:
    values = helper.make_tensor("sparse", TensorProto.FLOAT, [1], [1.0])
    places = helper.make_tensor("places", TensorProto.INT64, [1], [0])
    model.graph.sparse_initializer.append(helper.make_sparse_tensor(values, places, [2**40]))


def claim_a_huge_shape(model: Any) -> None:
    del model.graph.initializer[-1].dims[:]
    model.graph.initializer[-1].dims.extend([1 << 40, 1 << 40])


@pytest.mark.parametrize(
    ("attack", "message"),
    [
        (name_another_file, "holds external data"),
        (repeat_for_ever, "holds a subgraph|holds the operator 'Loop'"),
        (make_six_gigabytes, "holds the operator 'ConstantOfShape'"),
        (multiply_row_by_column, r"Mul on shapes \(40000, 1\), \(1, 40000\)"),
        (widen_again_and_again, "numbers between its operators; at most 262144"),
        (cast_a_constant_many_times, f"constants; at most {MOST_NUMBERS}"),
        (multiply_too_much, r"1\d{7} multiplications; at most 16777216"),
        (use_another_domain, "operators of the domain 'com.microsoft'"),
        (bring_a_function, "holds functions"),
        (hold_a_sparse_constant, "holds sparse_initializer"),
        (claim_a_huge_shape, r"bytes for the constant 'c2\d_1' of shape \(1099511627776"),
    ],
    ids=lambda value: getattr(value, "__name__", ""),
)
def test_a_hostile_network_is_refused_before_it_is_built(
    attack: Callable[[Any], None], message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def built(*_: object, **__: object) -> None:
        pytest.fail("ONNX Runtime has seen it")

    monkeypatch.setattr(onnxruntime, "InferenceSession", built)
    model = onnx.load_from_string(BYTES)
    attack(model)
    (tmp_path / "bad.onnx").write_bytes(model.SerializeToString())
    with pytest.raises(DriverError, match=message):
        Policy(tmp_path / "bad.onnx")


@pytest.mark.parametrize("name", sorted(path.name for path in SHIPPED.glob("*.onnx")))
def test_the_check_reads_what_onnx_reads(name: str) -> None:
    model = onnx.load(SHIPPED / name)
    network = network_in((SHIPPED / name).read_bytes(), name)
    assert network.metadata == {one.key: one.value for one in model.metadata_props}
    ends = (model.graph.input[0], model.graph.output[0])
    columns = [end.type.tensor_type.shape.dim[1].dim_value for end in ends]
    assert [network.columns, network.answers] == columns


def test_a_damaged_file_gives_a_network_or_one_kind_of_error() -> None:
    rng, refused = random.Random(5), 0
    for _ in range(1000):
        data = bytearray(BYTES)
        # Most of a file is weights, in which any bytes are numbers: damage the last part.
        for _ in range(rng.randint(1, 3)):
            data[-rng.randrange(1, 10_000)] = rng.randrange(256)
        try:
            network_in(bytes(data[: rng.choice((len(data), rng.randrange(len(data))))]), "it")
        except DriverError:
            refused += 1
    assert refused > 500


def test_a_file_of_nothing_but_fields_is_given_up_early() -> None:
    with pytest.raises(DriverError, match="holds more than 65536 fields"):
        network_in(b"\x72\x00" * 100_000, "it")  # that many empty entries of metadata
