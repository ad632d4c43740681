"""The shape of the source: small files, short functions, few parameters of kernels, no circles."""

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
MOST_LINES_OF_A_FILE = 350
MOST_LINES_OF_A_FUNCTION = 60
MOST_PARAMETERS_OF_A_KERNEL = 8

Function = ast.FunctionDef | ast.AsyncFunctionDef


@cache
def sources() -> dict[str, str]:
    """Return the text of every hand-written Python file of both packages, by its path."""
    files = [*ROOT.glob("race_server/**/*.py"), *ROOT.glob("agents/**/*.py")]
    return {
        path.relative_to(ROOT).as_posix(): path.read_text()
        for path in sorted(files)
        if "generated" not in path.parts and "page" not in path.parts
    }


@cache
def trees() -> dict[str, ast.Module]:
    return {path: ast.parse(text) for path, text in sources().items()}


def functions() -> Iterator[tuple[str, Function]]:
    for path, tree in trees().items():
        for node in ast.walk(tree):
            if isinstance(node, Function):
                yield path, node


def length_of(function: Function, *, has_options: bool) -> int:
    """Return the lines of a function; of a command those of its body, without its options."""
    first = function.body[0].lineno if has_options else function.lineno
    return (function.end_lineno or first) - first + 1


def names_of_decorators(function: Function) -> set[str]:
    return {node.id for node in function.decorator_list if isinstance(node, ast.Name)}


def test_no_file_is_longer_than_350_lines() -> None:
    lengths = {path: text.count("\n") for path, text in sources().items()}
    assert len(lengths) > 300
    assert {path: lines for path, lines in lengths.items() if lines > MOST_LINES_OF_A_FILE} == {}


def test_no_function_is_longer_than_60_lines_but_for_the_options_of_commands() -> None:
    long = {
        f"{path}:{function.name}": lines
        for path, function in functions()
        if (
            lines := length_of(
                function, has_options=path.startswith(("race_server/cli/", "agents/commands/"))
            )
        )
        > MOST_LINES_OF_A_FUNCTION
    }
    assert long == {}


def test_no_kernel_has_more_than_8_parameters() -> None:
    kernels = {
        f"{path}:{function.name}": len(function.args.args)
        for path, function in functions()
        if names_of_decorators(function) & {"kernel", "large_kernel"}
    }
    assert len(kernels) > 150
    many = {name: count for name, count in kernels.items() if count > MOST_PARAMETERS_OF_A_KERNEL}
    assert many == {}


def test_only_stamps_logs_and_keys_read_the_wall_clock() -> None:
    # A clock that is set by an hour, by hand or by a time server, moves no race.
    readers = re.compile(r"datetime\.now|utcnow|time\.time\(|time\.time_ns|time\.localtime")
    assert {path for path, text in sources().items() if readers.search(text)} == {
        "race_server/competition/time_trial/run.py",  # when a trial began
        "race_server/live/client/foxglove.py",  # what Foxglove shows beside a message
        "race_server/live/server/steward.py",  # when a decision was taken
        "race_server/logs.py",
        "race_server/net/auth/issue.py",
        "race_server/net/auth/keys.py",
        "race_server/storage/results/keeper.py",  # when a race began: its recording's name
    }


def imports_of(path: str, tree: ast.Module, modules: dict[str, str]) -> set[str]:
    """Return the files that a file imports, for type checkers as well."""
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module:
            names = [node.module, *(f"{node.module}.{each.name}" for each in node.names)]
            found |= {modules[name] for name in names if name in modules}
    return found - {path}


def circles(graph: dict[str, set[str]]) -> list[set[str]]:
    """Return the groups of files that reach each other by imports (Tarjan's algorithm)."""
    index: dict[str, int] = {}
    low: dict[str, int] = {}
    stack: list[str] = []
    found: list[set[str]] = []

    def visit(node: str) -> None:
        index[node] = low[node] = len(index)
        stack.append(node)
        for following in graph[node]:
            if following not in index:
                visit(following)
                low[node] = min(low[node], low[following])
            elif following in stack:
                low[node] = min(low[node], index[following])
        if low[node] == index[node]:
            group = set(stack[stack.index(node) :])
            del stack[stack.index(node) :]
            if len(group) > 1:
                found.append(group)

    for node in graph:
        if node not in index:
            visit(node)
    return found


def test_no_files_import_each_other_in_a_circle() -> None:
    modules = {
        path.removesuffix(".py")
        .removesuffix("/__init__")
        .replace("/", ".")
        .replace("agents.", "race_agents.", 1): path
        for path in sources()
        if path != "race_server/__init__.py"
    }
    graph = {path: imports_of(path, tree, modules) for path, tree in trees().items()}
    assert sum(map(len, graph.values())) > 1000
    assert circles(graph) == []


@pytest.mark.parametrize(
    ("graph", "circle"),
    [
        ({"a": {"b"}, "b": set()}, []),
        ({"a": {"b"}, "b": {"c"}, "c": {"a"}, "d": {"a"}}, [{"a", "b", "c"}]),
    ],
)
def test_a_circle_is_found_where_there_is_one(
    graph: dict[str, set[str]], circle: list[set[str]]
) -> None:
    assert circles(graph) == circle
