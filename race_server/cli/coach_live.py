"""`race coach --live`: what the laps of a race teach, told as each of them ends."""

import time
from typing import TYPE_CHECKING

from rich.text import Text

from race_server.cli.access import Access
from race_server.core.clock import MICROSECONDS, lap_text
from race_server.errors import RaceError, ScenarioError
from race_server.terminal import Console

if TYPE_CHECKING:
    from race_server.coaching.lesson import Coach, Lesson
    from race_server.competition.live_coach import Said
    from race_server.net.transport import ClientLink
    from race_server.scenario.track.course import Course

# Between two looks at what has come [s]; what comes later than that after the end is missed.
LOOK_S, LATE_S = 0.05, 0.5


def coach_race(
    given: Access, only: str, *, with_cues: bool, console: Console
) -> "dict[int, Lesson]":
    """Coach the drivers of a race until it ends; return what it taught them, by seat.

    only: one of them, by name.

    Raises:
        RaceError: the server does not answer or stops, its course or vehicles are not known here,
            or no driver completed a lap.
    """
    from race_server.competition.live_coach import LiveCoach
    from race_server.live.client.timing import ClientTiming
    from race_server.net.transport import ClientLink

    timeout_s = ClientTiming().spectator_timeout_s
    with ClientLink(given.address, given.session, keys=given.keys) as link:
        with console.status("finding the limit of the course", spinner="dots"):
            coaches = _coaches_of(link)
        live, over_s = LiveCoach(link, coaches), 0.0
        with console.status("listening", spinner="dots"):
            while not over_s or time.monotonic() < over_s + LATE_S:
                for said in live.heard():
                    if said.driver == (only or said.driver) and (with_cues or said.lap):
                        console.print(_line_of(said), soft_wrap=True)
                if live.race.is_over:
                    over_s = over_s or time.monotonic()
                elif live.silence_s() > timeout_s:
                    live.ask()  # raises where nothing answers
                time.sleep(LOOK_S)
        lessons = live.race.lessons()
    found = {seat: each for seat, each in lessons.items() if each.driver == (only or each.driver)}
    if not found:
        names = ", ".join(each.driver for each in lessons.values()) or "none"
        raise RaceError(
            f"no whole lap of {only or 'any driver'} was seen; drivers with laps: {names}"
        )
    return found


def _coaches_of(link: "ClientLink") -> "dict[int, Coach] | Coach":
    """Return what laps of a race are compared with: one for all seats, or one for each.

    Raises:
        RaceError: the course or a vehicle of the race is not the one of that name here.
    """
    from race_server.coaching.lesson import Coach
    from race_server.core.vehicle_presets import vehicle_named
    from race_server.net.wire import topics
    from race_server.net.wire.lobby import decode_rules
    from race_server.net.wire.sheets import VEHICLES

    rules, _ = decode_rules(link.ask(topics.RULES))
    names = rules.get(VEHICLES, "").split(",")
    if names == [""]:
        raise RaceError("the server does not tell its vehicles: it is of an older version")
    course = _course_of(link)
    by_name = {
        name: Coach(course, vehicle_named(name), solve=True) for name in dict.fromkeys(names)
    }
    if len(by_name) == 1:
        return by_name[names[0]]
    return {seat: by_name[name] for seat, name in enumerate(names)}


def _course_of(link: "ClientLink") -> "Course":
    from race_server.net.wire import topics
    from race_server.net.wire.lobby import decode_course
    from race_server.scenario.track.load import load_course

    sheet = decode_course(link.ask(topics.COURSE))
    course = load_course(sheet.name)
    if course.digest != sheet.digest:
        raise ScenarioError(f"{sheet.name} is another course here than on the server")
    if course.lot is not None or not len(course.line):
        raise ScenarioError(f"{sheet.name} is a car park: there are no laps in it")
    return course


def _line_of(said: "Said") -> Text:
    """Return what is said as a line of the terminal."""
    if not said.lap:
        return Text(f"{said.driver}: {said.words} ({said.corner})", style="bold cyan")
    line = Text(f"{said.driver}, lap {said.lap}: {lap_text(said.time_us)}")
    if said.behind_us is None:
        return line.append(f", not compared: {said.words}", style="dim")
    line.append(f", {said.behind_us / MICROSECONDS:+.3f} s to the limit. ")
    return line.append(said.words or "No fault is seen.", style="bold")
