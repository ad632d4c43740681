"""A race and game server for karts, and the same world as a training environment.

The names below are the public API; `race_server.envs` has that of the training environments. Each
name is imported at its first use, so a driver's process does not import Gymnasium, and a program
that only reads errors does not import zenoh.
"""

import importlib
import sys
from types import MappingProxyType
from typing import TYPE_CHECKING

from race_server.version import __version__ as __version__

if TYPE_CHECKING:
    from race_server.core.driver import Briefing as Briefing
    from race_server.core.driver import Driver as Driver
    from race_server.core.driver import driver_named as driver_named
    from race_server.core.driver import driver_names as driver_names
    from race_server.core.messages import Button as Button
    from race_server.core.messages import Control as Control
    from race_server.core.messages import EventKind as EventKind
    from race_server.core.messages import Flag as Flag
    from race_server.core.messages import Phase as Phase
    from race_server.core.messages import Status as Status
    from race_server.core.observation import Layout as Layout
    from race_server.core.observation import Observation as Observation
    from race_server.core.observation import layout_of as layout_of
    from race_server.errors import DriverError as DriverError
    from race_server.errors import GatewayError as GatewayError
    from race_server.errors import KeysError as KeysError
    from race_server.errors import LinkError as LinkError
    from race_server.errors import LotError as LotError
    from race_server.errors import PlanError as PlanError
    from race_server.errors import RaceError as RaceError
    from race_server.errors import RecordingError as RecordingError
    from race_server.errors import ResultsError as ResultsError
    from race_server.errors import ScenarioError as ScenarioError
    from race_server.errors import SeatError as SeatError
    from race_server.errors import TrackError as TrackError
    from race_server.errors import VehicleError as VehicleError
    from race_server.errors import WireError as WireError
    from race_server.live.client.driver import KartClient as KartClient
    from race_server.live.client.driver import run_driver as run_driver
    from race_server.live.client.remote_env import RemoteRace as RemoteRace

# The module that defines each name.
_EXPORTS = MappingProxyType(
    {
        name: module
        for module, names in (
            ("race_server.core.driver", "Briefing Driver driver_named driver_names"),
            ("race_server.core.messages", "Button Control EventKind Flag Phase Status"),
            ("race_server.core.observation", "Layout Observation layout_of"),
            (
                "race_server.errors",
                "DriverError GatewayError KeysError LinkError LotError PlanError RaceError "
                "RecordingError ResultsError ScenarioError SeatError TrackError VehicleError "
                "WireError",
            ),
            ("race_server.live.client.driver", "KartClient run_driver"),
            ("race_server.live.client.remote_env", "RemoteRace"),
        )
        for name in names.split()
    }
)

__all__ = sorted(_EXPORTS)


def __getattr__(name: str) -> object:
    """Import the public name at its first use."""
    if name not in _EXPORTS:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(importlib.import_module(_EXPORTS[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *_EXPORTS})


# `gym.make("race_server:Kart/Race-v0")` imports this package and then looks the id up. A process
# that does not use Gymnasium does not pay for importing it.
if "gymnasium" in sys.modules:
    importlib.import_module("race_server.envs.registration").register_gymnasium()
