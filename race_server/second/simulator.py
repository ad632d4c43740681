"""Simulators by name."""

from collections.abc import Sequence
from typing import Protocol

from race_server.core.state import Floats, World
from race_server.errors import ScenarioError
from race_server.scenario.race import Scenario
from race_server.second import highway_itself
from race_server.second.highway_itself import HighwayItself, ItselfOptions
from race_server.second.highway_motion import HighwayMotion
from race_server.second.highway_options import NAME, HighwayOptions


class Simulator(Protocol):
    """Moves worlds on."""

    def __call__(self, world: World, controls: Floats, ticks: int) -> None:
        """Move every world on by `ticks` ticks under the same controls, (W, K, 4)."""


def simulator_named(name: str, scenarios: Sequence[Scenario]) -> Simulator:
    """Return the simulator of a name, such as ``highway-env`` or ``highway-env:actuators=ours``.

    scenarios: of the worlds, in the order of their courses.

    Raises:
        ScenarioError: there is none of that name, it is not installed, or it cannot move these
            vehicles.
    """
    kind, _, options = name.partition(":")
    if kind == highway_itself.NAME:
        return HighwayItself(scenarios, ItselfOptions.of(options))
    if kind != NAME:
        raise ScenarioError(
            f"simulator {kind!r} is unknown; choose {NAME} or {highway_itself.NAME}"
        )
    return HighwayMotion(scenarios, HighwayOptions.of(options))
