"""The names that programs may import from `race_server`; all other names may move."""

import ast
import inspect
import subprocess
import sys
from pathlib import Path

import race_server
from race_server import errors

PUBLIC = {
    "Briefing",
    "Button",
    "Control",
    "Driver",
    "DriverError",
    "EventKind",
    "Flag",
    "GatewayError",
    "KartClient",
    "KeysError",
    "Layout",
    "LinkError",
    "LotError",
    "Observation",
    "Phase",
    "PlanError",
    "RaceError",
    "RecordingError",
    "RemoteRace",
    "ResultsError",
    "ScenarioError",
    "SeatError",
    "Status",
    "TrackError",
    "VehicleError",
    "WireError",
    "driver_named",
    "driver_names",
    "layout_of",
    "run_driver",
}


def run(code: str) -> str:
    """Return what a fresh interpreter prints."""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return done.stdout.strip()


def test_the_package_exports_these_names_and_no_others() -> None:
    assert set(race_server.__all__) == PUBLIC
    assert set(dir(race_server)) >= PUBLIC | {"__version__"}


def test_every_exported_name_can_be_imported_and_is_the_one_that_is_used_inside() -> None:
    for name in PUBLIC:
        value = getattr(race_server, name)
        module = sys.modules[value.__module__]
        assert getattr(module, name) is value
        assert inspect.getdoc(value), f"{name} has no docstring"


def test_type_checkers_are_told_of_the_same_names_from_the_same_modules() -> None:
    tree = ast.parse(Path(race_server.__file__).read_text(encoding="utf-8"))
    declared = {
        alias.asname: node.module
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("race_server.")
        for alias in node.names
    }
    assert declared == dict(race_server._EXPORTS) | {"__version__": "race_server.version"}


def test_all_errors_are_exported() -> None:
    defined = {name for name, value in vars(errors).items() if inspect.isclass(value)}
    assert {name for name in PUBLIC if name.endswith("Error")} == {
        name for name in defined if issubclass(getattr(errors, name), errors.RaceError)
    }


def test_an_unknown_name_is_an_attribute_error_that_names_it() -> None:
    assert not hasattr(race_server, "KartServer")
    assert run(
        "import race_server\ntry: race_server.Nope\nexcept AttributeError as e: print(e)"
    ) == ("module 'race_server' has no attribute 'Nope'")


def test_importing_the_package_imports_no_large_library() -> None:
    code = (
        "import sys, race_server\n"
        "print(sorted({'numpy', 'numba', 'zenoh', 'gymnasium', 'typer'} & set(sys.modules)))\n"
        "race_server.LinkError, race_server.Control, race_server.Briefing\n"
        "print(sorted({'numba', 'zenoh', 'gymnasium', 'typer'} & set(sys.modules)))"
    )
    assert run(code).splitlines() == ["[]", "[]"]
