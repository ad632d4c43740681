"""`race coach --live`: what the laps of a race teach, told as each of them ends."""

import math
import time
from collections.abc import Iterator
from typing import TYPE_CHECKING

from rich.text import Text

from race_server.cli.access import Access
from race_server.core.clock import MICROSECONDS, lap_text
from race_server.errors import LinkError, RaceError, ScenarioError
from race_server.terminal import Console

if TYPE_CHECKING:
    from race_server.coaching.lesson import Coach, Lesson
    from race_server.competition.live_coach import LiveCoach, Said
    from race_server.net.transport import ClientLink
    from race_server.scenario.track.course import Course

# Between two looks at what has come [s]; what comes later than that after the end is missed.
LOOK_S, LATE_S = 0.05, 0.5


def coach_race(
    given: Access, only: str, *, with_cues: bool, tells: bool, console: Console
) -> "dict[int, Lesson]":
    """Coach the drivers of a race until it ends; return what it taught them, by seat.

    only: one of them, by name; tells: also tell them where they drive. Where the server stops
    before the end, what was seen counts.

    Raises:
        RaceError: the server does not answer, its course or vehicles are not known here, or no
            whole lap was seen.
    """
    from race_server.competition.live_coach import LiveCoach
    from race_server.live.client.timing import ClientTiming
    from race_server.net.transport import ClientLink
    from race_server.net.wire import topics
    from race_server.net.wire.hint import encode_hint

    timeout_s = ClientTiming().spectator_timeout_s
    with ClientLink(given.address, given.session, keys=given.keys) as link:
        with console.status("finding the limit of the course", spinner="dots"):
            coaches = _coaches_of(link)
        live = LiveCoach(link, coaches)
        try:
            with console.status("listening", spinner="dots"):
                for said in _told(live, timeout_s):
                    if said.driver != (only or said.driver):
                        continue
                    if tells:
                        hint = encode_hint(max(live.race.view.epoch, 0), said.hint)
                        link.tell(topics.COACH, hint, said.seat)
                        time.sleep(2.0 / topics.COACH_HZ)
                    if with_cues or not said.hint.is_cue:
                        console.print(_line_of(said), soft_wrap=True)
        except (LinkError, KeyboardInterrupt) as error:
            if not live.race.has_laps:
                raise
            console.print(f"stopped before the end: {error or 'Ctrl-C'}", style="yellow")
        lessons = live.race.lessons()
    found = {seat: each for seat, each in lessons.items() if each.driver == (only or each.driver)}
    if lessons and not found:
        console.print(f"no whole lap of {only} was seen; this is of the others", style="yellow")
    if not lessons:
        raise RaceError("no whole lap of any driver was seen")
    return found or lessons


def _told(live: "LiveCoach", timeout_s: float) -> Iterator["Said"]:
    """Yield what there is to say until the race is over.

    Raises:
        LinkError: the server has stopped.
    """
    over_s = math.inf
    while time.monotonic() < over_s + LATE_S:
        yield from live.heard()
        if live.race.is_over:
            over_s = min(over_s, time.monotonic())
        elif live.silence_s() > timeout_s:
            live.ask()
        time.sleep(LOOK_S)


def _coaches_of(link: "ClientLink") -> "list[Coach]":
    """Return what laps of a race are compared with: one for all seats, or one for each.

    Raises:
        RaceError: the course or a vehicle of the race is not known here, or is another one.
    """
    from race_server.coaching.lesson import Coach
    from race_server.core.vehicle_presets import vehicle_named
    from race_server.net.wire import topics
    from race_server.net.wire.lobby import decode_rules
    from race_server.net.wire.sheets import VEHICLES

    rules, _ = decode_rules(link.ask(topics.RULES))
    names = [name for name in rules.get(VEHICLES, "").split(",") if name]
    if not names:
        raise RaceError("the server does not tell its vehicles: it is of an older version")
    vehicles = {name: vehicle_named(_plain(name)) for name in dict.fromkeys(names)}
    first = vehicles[names[0]]
    if rules.get("kart_length") != str(first.length) or rules.get("kart_width") != str(first.width):
        raise RaceError(f"{first.name} is another vehicle here than on the server")
    course = _course_of(link)
    coaches = {name: Coach(course, vehicle, solve=True) for name, vehicle in vehicles.items()}
    return [coaches[name] for name in names]


def _course_of(link: "ClientLink") -> "Course":
    from race_server.net.wire import topics
    from race_server.net.wire.lobby import decode_course
    from race_server.scenario.track.load import load_course

    sheet = decode_course(link.ask(topics.COURSE))
    course = load_course(_plain(sheet.name))
    if course.digest != sheet.digest:
        raise ScenarioError(f"{sheet.name} is another course here than on the server")
    if course.lot is not None or not len(course.line):
        raise ScenarioError(f"{sheet.name} is a car park: there are no laps in it")
    return course


def _plain(name: str) -> str:
    """Return a name that a server told; one that names a file is refused."""
    if name.endswith(".toml") or "/" in name or "\\" in name:
        raise ScenarioError(f"{name}: the server names a file, and files of here are not opened")
    return name


def _line_of(said: "Said") -> Text:
    """Return what is said as a line of the terminal."""
    hint = said.hint
    if hint.is_cue:
        return Text(f"{said.driver}: {said.words} ({hint.corner})", style="bold cyan")
    line = Text(f"{said.driver}, lap {hint.lap}: {lap_text(hint.time_us)}")
    if hint.behind_us is None:
        return line.append(f", not compared: {said.words}", style="dim")
    line.append(f", {hint.behind_us / MICROSECONDS:+.3f} s to the limit. ")
    return line.append(said.words or "No fault is seen.", style="bold")
