"""Demonstrations from a recording: observations and controls of a seat in a live race.

The race is simulated again with all sensors, so the driver of the seat may have been a person.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from race_agents.training.demonstrations import About, Demonstrations
from race_agents.training.demonstrator import EVERYTHING
from race_server.core import codes
from race_server.core.clock import TICK_S
from race_server.core.messages import Event, EventKind
from race_server.core.observation import PRESETS
from race_server.core.state import Float32s
from race_server.errors import RecordingError
from race_server.session.session import Session
from race_server.storage.recording.reader import Recording, read_recording
from race_server.storage.recording.rerun import Rerun
from race_server.storage.recording.scenario_codec import unpack_scenario


@dataclass(frozen=True)
class RecordedDrive:
    """Figures of a seat in a recorded race."""

    laps: int = 0
    wall_contacts: int = 0


def demonstrations_in(path: Path, seat: int) -> tuple[Demonstrations, RecordedDrive]:
    """Return the demonstrations of a seat of a recording, and its figures.

    A pair is the observation when a decision was due, and the control that acted last before the
    next one: by then an answer over the network has come. There are none before the start, none
    after the finish of the kart, and none while the parking driver of the server drives it.

    Raises:
        RecordingError: the recording is damaged, differs when simulated, or its seat has no driver
            that drove.
    """
    recording = read_recording(path)
    about = _about(recording, seat)
    _check_alike(recording)
    watched = Rerun(_seeing_everything(recording, seat))
    session, due = watched.session, watched.recording.start.decision_ticks
    pairs: list[tuple[Float32s, Float32s]] = []
    events: list[Event] = []
    seen, control, races = _look(session, seat), session.acting(seat), True
    is_own = True  # the driver of the seat has driven since the last decision
    for happened in watched.run(most_ticks=1):
        events += [event for event in happened if event.kart == seat]
        # After its finish the control is no longer the driver's.
        control = session.acting(seat) if races else control
        races = _races(session, seat)
        is_own &= not session.seats[seat].is_led
        if session.tick % due == 0:
            pairs += [(seen, control)] if seen is not None and is_own else []
            seen, is_own = _look(session, seat), True
    if seen is not None and is_own and session.tick % due:
        pairs.append((seen, control))  # the race was over before the next decision
    if not pairs:
        raise RecordingError(
            f"{path}: the kart of seat {seat} never raced, or only while the server's parking "
            "driver drove it; choose another seat"
        )
    observations, controls = (np.stack(column) for column in zip(*pairs, strict=True))
    return Demonstrations(about, observations, controls), _drive_of(events)


def _about(recording: Recording, seat: int) -> About:
    """Return the origin of the demonstrations of a seat.

    Raises:
        RecordingError: the seat is empty, or has a real kart, whose controls are not recorded.
    """
    rows = {row.number: row for row in recording.start.seats}
    if seat not in rows:
        taken = ", ".join(f"{number} ({row.driver})" for number, row in sorted(rows.items()))
        raise RecordingError(f"{recording.path}: seat {seat} is empty; choose one of {taken}")
    if rows[seat].is_tracked:
        raise RecordingError(
            f"{recording.path}: seat {seat} is a real kart, which moves by its poses: its controls "
            "are not recorded; choose another seat"
        )
    scenario = unpack_scenario(recording.start.setting, recording.start.arrays)
    return About(
        driver=rows[seat].driver,
        tracks=(scenario.course.name,),
        vehicle=scenario.vehicle_of(seat).name,
        parts=PRESETS[EVERYTHING],
        lidar_rays=scenario.lidar.rays,
        lidar_field=scenario.lidar.field,
        lidar_reach=scenario.lidar.reach,
        decision_s=recording.start.decision_ticks * TICK_S,
    )


def _check_alike(recording: Recording) -> None:
    """Check that the simulated race equals the recorded one.

    Raises:
        RecordingError: it differs, so the observations of the seat are unknown.
    """
    rerun = Rerun(recording)
    for _ in rerun.run():
        pass
    if rerun.difference is not None:
        raise RecordingError(
            f"{recording.path}: the simulated race differs from the recorded one from tick "
            f"{rerun.difference.tick} on; `race replay` lists the versions that recorded it"
        )


def _seeing_everything(recording: Recording, seat: int) -> Recording:
    """Return the recording with all sensors on one kart.

    They change only the digest, which includes the sensors of a kart.
    """
    rows = tuple(
        replace(row, preset=EVERYTHING) if row.number == seat else row
        for row in recording.start.seats
    )
    return replace(recording, start=replace(recording.start, seats=rows), digests=[])


def _races(session: Session, seat: int) -> bool:
    return bool(session.world.bodies[0, seat].status == codes.RACING)


def _look(session: Session, seat: int) -> Float32s | None:
    """Return the observation of a seat, None while its kart does not race."""
    if not _races(session, seat) or session.tick < session.world.races[0].start_tick:
        return None
    session.observe()
    return session.view(seat).copy()


def _drive_of(events: list[Event]) -> RecordedDrive:
    kinds = [event.kind for event in events]
    return RecordedDrive(kinds.count(EventKind.LAP), kinds.count(EventKind.CONTACT_WALL))
