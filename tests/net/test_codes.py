"""The enumerations of the schemas and those of the Python code are the same."""

import importlib
from enum import IntEnum, IntFlag

import pytest

from race_server.core import alert, codes, hint, messages, telemetry
from race_server.net.wire.generate import PACKAGE, TARGET
from race_server.session.failsafe import FailsafeStage
from race_server.session.interventions import InterventionKind

PYTHON: dict[str, type[IntEnum] | type[IntFlag]] = {
    name: enumeration
    for module in (messages, alert, telemetry, hint)
    for name, enumeration in vars(module).items()
    if isinstance(enumeration, type)
    and issubclass(enumeration, IntEnum | IntFlag)
    and enumeration.__module__ == module.__name__
}
PYTHON |= {"FailsafeStage": FailsafeStage, "InterventionKind": InterventionKind}
# Of the schemas alone: the default of a field must be a member.
ONLY_IN_SCHEMAS = {"EventKind": {"NONE": 0}, "InterventionKind": {"NONE": 0}}
# Of Python alone: flatc gives no name to the empty set of bits.
ONLY_IN_PYTHON = {"Button": {"NONE": 0}, "Cause": {"NONE": 0}}


def numbers_in_schemas(name: str) -> dict[str, int]:
    module = importlib.import_module(f"{PACKAGE}.codes.{name}")
    return {key: value for key, value in vars(getattr(module, name)).items() if key.isupper()}


def test_the_schemas_have_the_enumerations_of_the_python_code_and_no_others() -> None:
    generated = {path.stem for path in (TARGET / "codes").glob("*.py")} - {"__init__"}
    assert generated == set(PYTHON)


@pytest.mark.parametrize("name", sorted(PYTHON))
def test_a_number_has_the_same_name_in_the_schemas_and_in_python(name: str) -> None:
    in_python = {key: int(member) for key, member in PYTHON[name].__members__.items()}
    assert numbers_in_schemas(name) | ONLY_IN_PYTHON.get(name, {}) == (
        in_python | ONLY_IN_SCHEMAS.get(name, {})
    )


def test_the_kernels_have_the_numbers_of_the_enumerations() -> None:
    for kind in messages.EventKind:
        if kind is not messages.EventKind.PHASE:  # reported by the session, by no kernel
            assert getattr(codes, f"EVENT_{kind.name}") == kind
    assert tuple(messages.RayHit)[:3] == (codes.NOTHING, codes.BORDER, codes.OBSTACLE)
    assert (codes.HAZARD_HIT, codes.KART_HIT) == (messages.RayHit.HAZARD, messages.RayHit.KART)
    assert codes.PERSON == messages.RayHit.PERSON
    for trust in messages.Trust:
        assert getattr(codes, trust.name) == trust
