"""The leaderboard of a recorded race in the terminal, at any speed."""

import time
from collections import deque

from rich.console import Group
from rich.live import Live
from rich.text import Text

from race_server.core.clock import TICKS_PER_SECOND
from race_server.core.messages import Event, EventKind, Flag
from race_server.core.rules.items import items
from race_server.errors import RecordingError
from race_server.live.client.leaderboard import Headline, event_text, leaderboard
from race_server.storage.recording.reader import Recording
from race_server.storage.recording.rerun import Rerun
from race_server.terminal import Console

EVENT_LINES = 8  # under the leaderboard
REFRESH_HZ = 8
_SILENT = {EventKind.SECTOR, EventKind.EFFECT_END, EventKind.PHASE}


def show(recording: Recording, console: Console, *, speed: float, seek_s: float) -> None:
    """Simulate a recording again at `speed` times real time and show it from `seek_s` [s] on.

    Raises:
        RecordingError: `seek_s` is out of range, or the simulated race differs.
    """
    last_s = recording.last_tick / TICKS_PER_SECOND
    if not 0.0 <= seek_s <= last_s:
        raise RecordingError(f"the recording lasts {last_s:.1f} s; {seek_s:g} s is not in it")
    rerun = Rerun(recording)
    told: deque[Text] = deque(maxlen=EVENT_LINES)
    names = [""] * 64
    for row in recording.start.seats:
        names[row.number] = f"{row.driver} {row.number}"
    with Live(console=console, refresh_per_second=REFRESH_HZ) as live:
        begun = time.monotonic() - seek_s / speed
        for events in rerun.run(most_ticks=max(round(speed * TICKS_PER_SECOND / REFRESH_HZ), 1)):
            told.extend(_lines(events, names))
            at_s = rerun.session.tick / TICKS_PER_SECOND
            if at_s >= seek_s:
                live.update(_board(rerun, told))
                time.sleep(max(begun + at_s / speed - time.monotonic(), 0.0))
        live.update(_board(rerun, told))
    if rerun.difference is not None:
        raise RecordingError(
            f"recording {recording.path} differs from the simulated race from tick "
            f"{rerun.difference.tick} on; `race replay` without --play says more"
        )


def _lines(events: list[Event], names: list[str]) -> list[Text]:
    known = [item.name for item in items()]
    lines = []
    for event in events:
        text = "" if event.kind in _SILENT else event_text(event, names, known)
        if text:
            lines.append(Text(f"{event.tick / TICKS_PER_SECOND:7.2f}  {text}", style="dim"))
    return lines


def _board(rerun: Rerun, told: deque[Text]) -> Group:
    session = rerun.session
    race = session.world.races[0]
    headline = Headline(
        f"{session.name}, recorded {rerun.recording.start.started_at[:16]}",
        session.scenario.course.name,
        session.scenario.rules.laps,
        session.phase,
        Flag(int(race.flag)),
        (session.tick - int(race.start_tick)) / TICKS_PER_SECOND,
    )
    return Group(leaderboard(headline, session.standings()), *told)
