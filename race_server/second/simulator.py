"""Simulators by name."""

from collections.abc import Sequence
from typing import Protocol

from race_server.core.state import Floats, World
from race_server.errors import ScenarioError
from race_server.scenario.highway import INSTALL, has_highway
from race_server.scenario.race import Scenario
from race_server.second import highway_itself
from race_server.second.highway_itself import HighwayItself, ItselfOptions
from race_server.second.highway_motion import HighwayMotion
from race_server.second.highway_options import NAME, HighwayOptions


class Simulator(Protocol):
    """Moves worlds on."""

    def __call__(self, world: World, controls: Floats, ticks: int) -> None:
        """Move every world on by `ticks` ticks under the same controls, (W, K, 4)."""


def check_simulator(name: str) -> None:
    """Check a simulator's name before anything is built for it.

    Raises:
        ScenarioError: there is none of that name, or it is not installed.
    """
    kind, _, options = name.partition(":")
    readers = {NAME: HighwayOptions.of, highway_itself.NAME: ItselfOptions.of}
    if kind not in readers:
        raise ScenarioError(f"simulator {kind!r} is unknown; choose {' or '.join(readers)}")
    readers[kind](options)
    if not has_highway():
        raise ScenarioError(f"highway-env is not installed: {INSTALL}")


def simulator_named(name: str, scenarios: Sequence[Scenario]) -> Simulator:
    """Return the simulator of a name, such as ``highway-env`` or ``highway-env:actuators=ours``.

    scenarios: of the worlds, in the order of their courses.

    Raises:
        ScenarioError: there is none of that name, it is not installed, or it cannot move these
            vehicles.
    """
    kind, _, options = name.partition(":")
    check_simulator(name)
    if kind == highway_itself.NAME:
        return HighwayItself(scenarios, ItselfOptions.of(options))
    return HighwayMotion(scenarios, HighwayOptions.of(options))
