"""An event on the network as its file holds it: enough to go on after any interruption."""

import json
import math
from dataclasses import asdict, dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import Any

from race_server.competition.race_day.day import Day
from race_server.competition.race_day.formats import Format
from race_server.competition.race_day.formats.reader import format_of, words_of
from race_server.competition.race_day.plan import DayPlan
from race_server.competition.race_day.protest import Protest
from race_server.competition.race_day.record import RaceRecord, Team
from race_server.core.bounds import MOST_KARTS
from race_server.core.seeds import MOST_SEED
from race_server.core.vehicle_presets import vehicle_named
from race_server.errors import RaceError, ScenarioError
from race_server.kept_file import free_aside
from race_server.plain_data import made_of
from race_server.scenario.track.load import load_course
from race_server.storage.whole_file import write_whole

VERSION = 1
SUFFIX = ".event.json"
# When an event that is over began, in the name of its file.
STAMP = "????????T??????"


@dataclass(frozen=True)
class Entrant:
    """A driver of an event and its seat."""

    seat: int
    team: str  # its number and name in all tables, different for each
    driver: str  # as it joined
    preset: str  # what it observes
    key: str  # of its secret, in hexadecimal digits
    number: int = 0  # by which spectators know it; 0: none
    is_local: bool = False  # inside the server
    is_apart: bool = False  # a process that the server starts
    is_tracked: bool = False  # a real kart
    is_sent_away: bool = False  # by stewards, for the rest of the event


@dataclass(frozen=True)
class EventState:
    """An event so far."""

    name: str
    begun_at: str  # UTC, ISO 8601
    format: Format
    tracks: dict[str, str]  # names of the courses by letter
    vehicle: str
    seed: int
    pace: str
    needs_line: bool
    entrants: tuple[Entrant, ...]
    epoch: int = 0  # of the last race
    records: tuple[RaceRecord, ...] = ()  # of the attempts and races so far
    protests: tuple[Protest, ...] = ()
    reviewed: str = ""  # the newest stage, or round of races, whose review is over
    is_final: bool = False

    def plan(self) -> DayPlan:
        """Return the event as it was planned.

        Raises:
            RaceError: a course or the vehicle does not exist any more.
        """
        return DayPlan(
            format=self.format,
            teams=tuple(Team(one.team, one.driver) for one in self.entrants),
            courses={letter: load_course(name) for letter, name in self.tracks.items()},
            vehicle=vehicle_named(self.vehicle),
            seed=self.seed,
            needs_line=self.needs_line,
            waits=self.pace == "lockstep",
        )

    def day(self) -> Day:
        """Return the event as it stands.

        Raises:
            RaceError: a course or the vehicle does not exist any more, or there are more records
                than attempts and races.
        """
        return Day(self.plan(), self.name, self.records, self.protests)

    def words(self) -> dict[str, Any]:
        """Return the event as plain data."""
        plain = asdict(replace(self, format=Format("", "", ())))
        form = {"name": self.format.name, **words_of(self.format)}
        return {"version": VERSION, **plain, "format": form}


class EventFile:
    """The file of the event of a server, beside its recordings."""

    def __init__(self, folder: Path, name: str) -> None:
        """Name the file; nothing is read or written."""
        self.path = folder / f"{name}{SUFFIX}"

    def read(self) -> EventState | None:
        """Return the event that has begun and is not over, None where there is none.

        Raises:
            ScenarioError: it cannot be read.
        """
        return read_event(self.path) if self.path.exists() else None

    def write(self, state: EventState) -> None:
        """Write the event; one that is over gets the time of its begin as its name.

        Raises:
            RaceError: the file cannot be written.
        """
        try:
            write_whole(self.path, json.dumps(state.words(), indent=1))
        except OSError as error:
            raise RaceError(
                f"the event cannot be written to {self.path} ({error.strerror or error}); make "
                "room: a server that starts again goes on from the last attempt or race written"
            ) from error
        if state.is_final:
            self.put_away(state)

    def put_away(self, state: EventState) -> None:
        """Keep an event that is over, or does not go on, under a name of its time."""
        session = self.path.name.removesuffix(SUFFIX)
        stamp = "".join(c for c in state.begun_at[:19] if c.isalnum())
        self.path.replace(self.path.with_name(f"{session}-{stamp}{SUFFIX}"))

    def put_aside(self) -> Path:
        """Keep an event that cannot be read under another name, and return it."""
        aside = free_aside(self.path, "unreadable", SUFFIX)
        self.path.replace(aside)
        return aside


def event_files(folder: Path, session: str = "") -> list[Path]:
    """Return the files of the events of a session, the newest first. session: "" for any."""
    names = (f"{session}{SUFFIX}", f"{session}-{STAMP}{SUFFIX}") if session else (f"*{SUFFIX}",)
    found = [path for name in names for path in folder.glob(name)]
    return sorted(found, key=lambda path: path.stat().st_mtime, reverse=True)


def read_event(path: Path) -> EventState:
    """Return the event in a file.

    Raises:
        ScenarioError: it cannot be read, is damaged, or of a newer race-server.
    """
    try:
        words = json.loads(
            path.read_text(encoding="utf-8"), parse_constant=_finite, parse_float=_finite
        )
        version = words.pop("version")
        if version > VERSION:
            raise ScenarioError(
                f"event {path} is of a newer race-server (version {version}, this one knows "
                f"{VERSION}); update race-server"
            )
        form = words.pop("format")
        name = form.pop("name")
        return _checked(made_of(EventState, words | {"format": format_of(name, form, str(path))}))
    except OSError as error:
        raise ScenarioError(f"event {path} cannot be read: {error.strerror or error}") from error
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise ScenarioError(
            f"event {path} is damaged ({type(error).__name__}: {error}); move it away, or begin "
            "another event with --fresh"
        ) from error


def _finite(digits: str) -> float:
    """Return a number of a file.

    Raises:
        ValueError: it is not finite.
    """
    value = float(digits)
    if not math.isfinite(value):
        raise ValueError(f"{digits[:20]} is no finite number")
    return value


def _checked(state: EventState) -> EventState:
    """Return an event once it is checked what its parts say of one another.

    Raises:
        ValueError: they do not fit together.
    """
    datetime.fromisoformat(state.begun_at)
    if not 0 <= state.seed <= MOST_SEED:
        raise ValueError(f"seed = {state.seed}: give one from 0 to {MOST_SEED}")
    if missing := set(state.format.letters) - set(state.tracks):
        raise ValueError(f"tracks: there is none for letter {', '.join(sorted(missing))}")
    _check_entrants(state.entrants)
    teams = {one.team for one in state.entrants}
    for record in state.records:
        driven = {one.team for one in record.drives}
        if not driven or not driven <= teams:
            others = ", ".join(sorted(driven - teams)) or "no team"
            raise ValueError(f"a record is of {others}, not of the entrants")
        if record.grid and not driven <= set(record.grid) <= teams:
            raise ValueError(f"the grid of a record is {', '.join(record.grid)}: not its teams")
    for protest in state.protests:
        if protest.against not in teams or not 0 <= protest.drive < len(state.records):
            raise ValueError(f"protest {protest.number} is about no result of the event")
    return state


def _check_entrants(entrants: tuple[Entrant, ...]) -> None:
    """Check that there are drivers, each on a seat and with a name that no other has.

    Raises:
        ValueError: they do not fit together.
    """
    if not entrants:
        raise ValueError("entrants: there are none")
    for one in entrants:
        bytes.fromhex(one.key)
        if not 0 <= one.seat < MOST_KARTS:
            raise ValueError(f"an entrant has seat {one.seat}: give one from 0 to {MOST_KARTS - 1}")
    for what in ("team", "seat"):
        given = [getattr(one, what) for one in entrants]
        if twice := [one for one in given if given.count(one) > 1]:
            raise ValueError(f"two entrants have the {what} {twice[0]!r}")
