"""An ONNX graph that is written layer by layer, so that it depends on nothing but ONNX itself."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

from race_agents.policies.metadata import (
    DIGEST,
    INPUT,
    KEY,
    OUTPUT,
    PolicyMetadata,
    digest_of,
)
from race_server.kept_file import write_file
from race_server.version import __version__

OPSET, IR_VERSION = 17, 8  # old enough for every ONNX Runtime that runs on our Pythons


@dataclass
class OnnxGraph:
    """A graph that grows at its end."""

    nodes: list[Any] = field(default_factory=list)
    constants: list[Any] = field(default_factory=list)
    end: str = INPUT

    def then(self, operator: str, *constants: Any, **attributes: Any) -> None:
        """Add an operator behind the end, with constants as its further inputs."""
        self.end = self.add(operator, self.end, *constants, **attributes)

    def add(self, operator: str, *inputs: Any, **attributes: Any) -> str:
        """Add an operator and return its name; inputs are names of others, or constants."""
        number = len(self.nodes)
        names = []
        for place, value in enumerate(inputs):
            if not isinstance(value, str):
                self.constants.append(
                    numpy_helper.from_array(np.asarray(value), f"c{number}_{place}")
                )
            names.append(value if isinstance(value, str) else f"c{number}_{place}")
        output = f"x{number}"
        self.nodes.append(helper.make_node(operator, names, [output], **attributes))
        return output


def write_graph(path: Path, graph: OnnxGraph, metadata: PolicyMetadata, width: int) -> None:
    """Write a graph as a policy file. width: numbers of its answer."""
    data = policy_of(model_of(graph, metadata, width), metadata)
    write_file(path, lambda file: file.write(data))


def model_of(graph: OnnxGraph, metadata: PolicyMetadata, width: int) -> Any:
    """Return a graph as a model. width: numbers of its answer."""
    # The last output gets the name that drivers look for.
    graph.nodes[-1].output[0] = OUTPUT
    seen = helper.make_tensor_value_info(INPUT, TensorProto.FLOAT, ["n", metadata.size])
    answer = helper.make_tensor_value_info(OUTPUT, TensorProto.FLOAT, ["n", width])
    body = helper.make_graph(graph.nodes, "policy", [seen], [answer], graph.constants)
    return helper.make_model(
        body,
        producer_name="race-server",
        producer_version=__version__,
        ir_version=IR_VERSION,
        opset_imports=[helper.make_opsetid("", OPSET)],
    )


def policy_of(model: Any, metadata: PolicyMetadata) -> bytes:
    """Return the bytes of a policy file: a model with its metadata.

    Raises:
        onnx.checker.ValidationError: ONNX does not take the model.
    """
    words = metadata.as_text()
    digest = digest_of(model.graph.SerializeToString(), words)
    helper.set_model_props(model, {KEY: words, DIGEST: digest})
    onnx.checker.check_model(model)
    return bytes(model.SerializeToString())
