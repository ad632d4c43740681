"""Check the network of a policy file before ONNX Runtime sees it.

A policy is what `race_agents.training` writes: operators of one list, one after the other,
on one table of observations, with constants that lie in the file. All else that ONNX knows is
refused: data in other files, subgraphs and loops, functions, other domains, sparse and
computed constants. What is left costs an amount of time and memory that is known before it runs.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from race_agents.policies.metadata import DIGEST, INPUT, KEY, OUTPUT, digest_of
from race_agents.policies.protobuf import DamageError, Field, Fields, Kind, Reader, text_of
from race_server.errors import DriverError

# A decision on one core takes about 10 ms at these limits.
MOST_WORK = 1 << 24  # multiplications of a decision
MOST_COLUMNS = 1 << 18  # numbers that all operators answer together, for one observation
MOST_NUMBERS = 1 << 24  # constants, those included that are made by casting others
MOST_NODES = 1024
MOST_METADATA = 1 << 20  # bytes
DOMAINS = ("", "ai.onnx")

INT, REFUSED = Kind.INT, Kind.REFUSED
_DOC = Field("doc_string")
MODEL = {
    1: Field("ir_version", INT),
    2: Field("producer_name"),
    3: Field("producer_version"),
    4: Field("domain"),
    5: Field("model_version", INT),
    6: _DOC,
    7: Field("graph"),
    8: Field("opset_import", is_repeated=True),
    14: Field("metadata_props", is_repeated=True),
    20: Field("training_info", REFUSED),
    25: Field("functions", REFUSED),
}
OPSET = {1: Field("domain"), 2: Field("version", INT)}
ENTRY = {1: Field("key"), 2: Field("value")}
GRAPH = {
    1: Field("node", is_repeated=True),
    2: Field("name"),
    5: Field("initializer", is_repeated=True),
    10: _DOC,
    11: Field("input", is_repeated=True),
    12: Field("output", is_repeated=True),
    15: Field("sparse_initializer", REFUSED),
}
NODE = {
    1: Field("input", is_repeated=True),
    2: Field("output", is_repeated=True),
    3: Field("name"),
    4: Field("op_type"),
    6: _DOC,
    7: Field("domain"),
    5: Field("attribute", is_repeated=True),
}
ATTRIBUTE = {
    1: Field("name"),
    2: Field("f", Kind.FLOAT),
    3: Field("i", INT),
    20: Field("type", INT),
    5: Field("a tensor", REFUSED),
    6: Field("a subgraph", REFUSED),
    13: _DOC,
    11: Field("subgraphs", REFUSED),
}
TENSOR = {
    1: Field("dims", INT, is_repeated=True),
    2: Field("data_type", INT),
    8: Field("name"),
    9: Field("raw_data"),
    12: _DOC,
    13: Field("external data", REFUSED),
    14: Field("a place of external data", REFUSED),
}
END = {1: Field("name"), 2: Field("type"), 3: _DOC}
TYPE = {1: Field("tensor_type")}
TENSOR_TYPE = {1: Field("elem_type", INT), 2: Field("shape")}
SHAPE = {1: Field("dim", is_repeated=True)}
DIM = {1: Field("dim_value", INT), 2: Field("dim_param")}

# Bytes of one number: float, int64, bool, double.
ITEM_BYTES = {1: 4, 7: 8, 9: 1, 11: 8}
# Operators that answer each number by itself, and their attributes.
ELEMENTWISE = {
    **dict.fromkeys(("Add", "Sub", "Mul", "Div", "Max", "Min", "Greater", "Where", "Clip"), ()),
    **dict.fromkeys(("Log", "Tanh", "Relu", "Sigmoid", "Exp", "Sqrt", "Softplus", "Identity"), ()),
    **dict.fromkeys(("Elu", "LeakyRelu"), ("alpha",)),
    "Cast": ("to",),
}

Dims = tuple[int, ...]


@dataclass(frozen=True)
class Value:
    """What an operator takes or answers: a table of n rows, or a constant."""

    dims: Dims  # of a constant; of a table only the number of its columns
    is_table: bool = True


@dataclass
class Network:
    """What a policy file holds."""

    metadata: dict[str, str]
    columns: int  # of the observation
    answers: int  # columns of the action


@dataclass
class _Graph:
    """A graph that is checked operator by operator."""

    values: dict[str, Value] = field(default_factory=dict)
    work: int = 0
    columns: int = 0
    numbers: int = 0

    def add(self, name: str, value: Value) -> None:
        """Count a value, and let later operators take it."""
        if name in self.values or not name:
            raise DamageError(f"names {name[:60]!r} twice or not at all")
        if value.is_table:
            self.columns += value.dims[0]
        else:
            self.numbers += math.prod(value.dims)
        _limit("constants", self.numbers, MOST_NUMBERS)
        _limit("numbers between its operators", self.columns, MOST_COLUMNS)
        _limit("multiplications", self.work, MOST_WORK)
        self.values[name] = value

    def take(self, name: str) -> Value:
        """Return what an operator takes."""
        if name not in self.values:
            raise DamageError(f"takes {name[:60]!r}, which nothing before it answers")
        return self.values[name]


def network_in(data: bytes, name: str) -> Network:
    """Return what a policy file holds, checked.

    Raises:
        DriverError: it is no ONNX file, or holds what no policy has.
    """
    reader = Reader()
    try:
        model = reader.read(memoryview(data), MODEL)
    except DamageError as error:
        raise _refusal(name, error) from error
    if "graph" not in model:
        raise DriverError(f"{name} is damaged or no ONNX file; export it again")
    try:
        _check_opsets(reader, model)
        columns, answers = _check_graph(reader, reader.read(model["graph"][0], GRAPH))
        metadata = _metadata_in(reader, model)
        _check_digest(model["graph"][0], metadata)
        return Network(metadata, columns, answers)
    except DamageError as error:
        raise _refusal(name, error) from error


def _refusal(name: str, error: DamageError) -> DriverError:
    return DriverError(
        f"{name} is damaged or no ONNX file of a policy: it {error}; export it again, "
        "or train one with `race train`"
    )


def _check_opsets(reader: Reader, model: Fields) -> None:
    for data in model.get("opset_import", ()):
        domain = _text(reader.read(data, OPSET), "domain")
        if domain not in DOMAINS:
            raise DamageError(f"holds operators of the domain {domain[:60]!r}")


def _metadata_in(reader: Reader, model: Fields) -> dict[str, str]:
    found = {}
    for data in model.get("metadata_props", ()):
        _limit("bytes of metadata", len(data), MOST_METADATA)
        entry = reader.read(data, ENTRY)
        found[_text(entry, "key")] = _text(entry, "value")
    return found


def _check_digest(graph: memoryview, metadata: dict[str, str]) -> None:
    """Compare a file with what was exported; those of earlier versions have no digest."""
    if DIGEST in metadata and metadata[DIGEST] != digest_of(graph, metadata.get(KEY, "")):
        raise DamageError("is not as it was exported: its digest is another one")


def _check_graph(reader: Reader, body: Fields) -> tuple[int, int]:
    """Return the columns of the observation and of the action."""
    graph = _Graph()
    inputs = [_end(reader, data) for data in body.get("input", ())]
    outputs = [_end(reader, data) for data in body.get("output", ())]
    if [name for name, _ in inputs] != [INPUT] or [name for name, _ in outputs] != [OUTPUT]:
        raise DamageError(f"takes and answers other than {INPUT!r} and {OUTPUT!r}")
    columns = inputs[0][1]
    graph.add(INPUT, Value((columns,)))
    for data in body.get("initializer", ()):
        graph.add(*_constant(reader.read(data, TENSOR)))
    nodes = body.get("node", ())
    _limit("operators", len(nodes), MOST_NODES)
    for data in nodes:
        _check_node(reader, reader.read(data, NODE), graph)
    answer = graph.take(OUTPUT)
    if not answer.is_table:
        raise DamageError("answers without regard to what it sees")
    return columns, answer.dims[0]


def _end(reader: Reader, data: memoryview) -> tuple[str, int]:
    """Return name and columns of an input or output, which is a table."""
    end = reader.read(data, END)
    kind = reader.read(_only(end, "type"), TYPE)
    shape = reader.read(_only(reader.read(_only(kind, "tensor_type"), TENSOR_TYPE), "shape"), SHAPE)
    dims = [reader.read(dim, DIM) for dim in shape.get("dim", ())]
    columns = dims[1].get("dim_value", [0])[0] if len(dims) == 2 else 0
    if columns < 1:
        raise DamageError(f"takes or answers {_text(end, 'name')[:60]!r}, which is no table")
    return _text(end, "name"), columns


def _constant(tensor: Fields) -> tuple[str, Value]:
    name, dims = _text(tensor, "name"), tuple(tensor.get("dims", ()))
    item = ITEM_BYTES.get(tensor.get("data_type", [0])[0])
    size = len(_only(tensor, "raw_data"))
    if item is None or len(dims) > 2 or min(dims, default=1) < 1:
        raise DamageError(f"holds a constant {name[:60]!r} of an unknown kind or shape")
    if math.prod(dims) * item != size:
        raise DamageError(f"holds {size} bytes for the constant {name[:60]!r} of shape {dims}")
    return name, Value(dims, is_table=False)


def _check_node(reader: Reader, node: Fields, graph: _Graph) -> None:
    operator, outputs = _text(node, "op_type"), node.get("output", ())
    rule = _RULES.get(operator)
    if rule is None or _text(node, "domain") not in DOMAINS:
        raise DamageError(f"holds the operator {operator[:60]!r}")
    settings = dict(_setting(reader.read(data, ATTRIBUTE)) for data in node.get("attribute", ()))
    known, check = rule
    if strange := set(settings) - set(known):
        raise DamageError(f"sets {min(strange)[:60]!r} of the operator {operator}")
    names = [text_of(one) for one in node.get("input", ())]
    if len(outputs) != 1:
        raise DamageError(f"holds the operator {operator} with {len(outputs)} answers")
    taken = [graph.take(name) for name in names if name]
    value = check(graph, taken, settings)
    if value is None:
        shapes = ", ".join(str(one.dims) for one in taken)
        raise DamageError(f"holds the operator {operator} on shapes {shapes}, which do not fit")
    graph.add(text_of(outputs[0]), value)


def _setting(attribute: Fields) -> tuple[str, float]:
    return _text(attribute, "name"), (attribute.get("i") or attribute.get("f") or [0])[0]


Settings = dict[str, float]


def _each(graph: _Graph, taken: list[Value], settings: Settings) -> Value | None:
    """Return the shape of numbers that are answered one by one; constants repeat along them."""
    tables = [one for one in taken if one.is_table]
    if not tables:
        # Only a cast makes a constant of a constant.
        return taken[0] if len(taken) == 1 and "to" in settings else None
    columns = max(one.dims[-1] for one in tables)
    for one in taken:
        if math.prod(one.dims[:-1]) != 1 or (one.dims and one.dims[-1] not in {1, columns}):
            return None
    return Value((columns,))


def _gather(graph: _Graph, taken: list[Value], settings: Settings) -> Value | None:
    fits = settings.get("axis") == 1 and _are(taken, True, False) and len(taken[1].dims) == 1
    return Value(taken[1].dims) if fits else None


def _multiply(graph: _Graph, taken: list[Value], settings: Settings) -> Value | None:
    if not _are(taken[:2], True, False) or len(taken[1].dims) != 2:
        return None
    weights = taken[1].dims[::-1] if settings.get("transB") else taken[1].dims
    added = taken[2:]
    if weights[0] != taken[0].dims[0] or not _are(added, *[False] * min(len(added), 1)):
        return None
    if any(one.dims[:-1] not in {(), (1,)} or one.dims[-1:] != weights[1:] for one in added):
        return None
    graph.work += weights[0] * weights[1]
    return Value(weights[1:])


def _choose(graph: _Graph, taken: list[Value], settings: Settings) -> Value | None:
    fits = settings.get("axis") == 1 and settings.get("keepdims", 1) == 1 and _are(taken, True)
    return Value((1,)) if fits else None


Check = Callable[[_Graph, list[Value], Settings], Value | None]
# Attributes of each operator that a policy may have, and what checks its shapes.
_RULES: dict[str, tuple[tuple[str, ...], Check]] = {
    **{name: (known, _each) for name, known in ELEMENTWISE.items()},
    "Gather": (("axis",), _gather),
    "MatMul": ((), _multiply),
    "Gemm": (("transB", "alpha", "beta"), _multiply),
    "ArgMax": (("axis", "keepdims"), _choose),
}


def _are(taken: list[Value], *tables: bool) -> bool:
    """Return whether some values are as many as wanted, each a table or a constant as wanted."""
    return [one.is_table for one in taken] == list(tables)


def _only(fields: Fields, name: str) -> Any:
    if name not in fields:
        raise DamageError(f"lacks {name}")
    return fields[name][0]


def _text(fields: Fields, name: str) -> str:
    return text_of(fields[name][0]) if name in fields else ""


def _limit(what: str, count: int, most: int) -> None:
    if count > most:
        raise DamageError(f"has {count} {what}; at most {most} are allowed")
