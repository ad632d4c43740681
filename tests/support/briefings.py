"""What drivers are told before the start."""

from typing import Any

from race_server.core.driver import Briefing
from race_server.core.vehicle_presets import TT02


def briefing(preset: str, **changes: Any) -> Briefing:
    """Return the briefing of a TT-02 on seat 0 in a race of three laps, 20 decisions a second."""
    usual = {"seat": 0, "vehicle": TT02, "laps": 3, "decision_s": 0.05}
    return Briefing(preset=preset, **{**usual, **changes})
