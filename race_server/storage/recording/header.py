"""How a race begins, as a recording holds it."""

import importlib.metadata
import json
from collections.abc import Container

from race_server.net.wire.journal import SeatRow, StartFrame
from race_server.session.session import Session
from race_server.storage.recording.scenario_codec import pack_scenario
from race_server.version import __version__

# What the world is computed with: another version may compute other digits.
COMPUTES = ("numpy", "numba", "llvmlite")


def header_of(
    session: Session, pace: str, started_at: str, local_seats: Container[int]
) -> StartFrame:
    """Return the beginning of a race that has just been started.

    started_at: UTC, ISO 8601; local_seats: those that are driven from inside the server.
    """
    setting, arrays = pack_scenario(session.scenario)
    seats = tuple(
        SeatRow(
            *(seat.number, seat.driver, seat.preset, seat.key),
            is_local=seat.number in local_seats,
            is_tracked=seat.is_tracked,
        )
        for seat in session.seats
        if seat.is_taken
    )
    return StartFrame(
        session=session.name,
        epoch=session.epoch,
        pace=pace,
        decision_ticks=session.decision_ticks,
        started_at=started_at,
        versions=json.dumps(versions()),
        setting=setting,
        arrays=arrays,
        seats=seats,
    )


def versions() -> dict[str, str]:
    """Return the versions of what the world is computed with, here and now."""
    return {
        "race-server": __version__,
        **{name: importlib.metadata.version(name) for name in COMPUTES},
    }
