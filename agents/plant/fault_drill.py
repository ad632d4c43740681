"""The drill of faults: a kart at 50 km/h, or at a stand, each fault in turn, and what happens."""

from collections.abc import Callable
from typing import Any

from race_agents.plant.faults import Case, Then, cases
from race_agents.plant.faulty import Drive, Happened
from race_agents.plant.trip import Course
from race_agents.unit.fence import CourseFence
from race_agents.unit.limits import Limits
from race_agents.unit.safety import GENTLE
from race_server.core.vehicles import Vehicle
from race_server.scenario.track.load import load_course

# A kart brakes after this time [s], and its way may be this much longer than what that makes.
REACTION_S, SPARE = 0.2, 1.1
# Driver and radio may be silent for this time [s] before the brakes begin.
PATIENCE_S = 0.8
# A kart that crawls, or touches a border, is at most this much faster than a kart that crawls.
CRAWLS = 1.2


def names() -> list[str]:
    """Return the names of all faults."""
    return [case.fault.name for case in cases()]


def measure(
    track: str, vehicle: Vehicle, seed: int, only: str, tell: Callable[[int], None]
) -> dict[str, Any]:
    """Return the document of the drill. only: one fault by its name, all if empty.

    Raises:
        TrackError: no such course.
    """
    loaded = load_course(track)
    course = Course(loaded.line, loaded.borders)
    fence = CourseFence.of(loaded.line, loaded.half_widths, loaded.kerb, loaded.borders)
    rows = []
    for case in cases():
        if only in ("", case.fault.name):
            happened = Drive(course, fence, vehicle, case.fault, seed).run()
            rows.append(row_of(case, happened, Limits.of(vehicle)))
            tell(len(rows))
    failed = [f"{row['name']}: {row['why']}" for row in rows if not row["ok"]]
    return {
        "ok": not failed,
        "why": "; ".join(failed),
        "track": track,
        "vehicle": vehicle.name,
        "seed": seed,
        "faults": rows,
    }


def row_of(case: Case, happened: Happened, limits: Limits) -> dict[str, Any]:
    """Return what a fault asked for and what happened, as plain data."""
    why, most_m = [], most_way(case.then, happened.speed, limits)
    shown_s = happened.flagged.get(case.shows) if case.shows else None
    if case.shows and (shown_s is None or shown_s > case.shows_s):
        why.append(f"{case.shows} shown after {shown_s} s, asked {case.shows_s:g} s")
    missing = [each for each in case.cause.as_json() if each not in happened.causes]
    if missing:
        why.append(f"did not slow down for {', '.join(missing)}")
    if most_m is not None and (happened.stood_s is None or happened.way_m > most_m):
        why.append(f"stopped within {happened.way_m:.1f} m, asked {most_m:.1f} m")
    crawls = CRAWLS * limits.slow_speed
    if case.then is Then.CRAWLS and happened.last > crawls:
        why.append(f"{happened.last:.1f} m/s at the end, asked {crawls:.1f} m/s")
    if happened.off_m > case.off_m:
        why.append(f"the place was off by {happened.off_m:.2f} m, asked {case.off_m:g} m")
    # Without a driver only the brakes are left.
    if happened.scraped > crawls and case.then is not Then.HALTS:
        why.append(f"touched a border at {happened.scraped:.1f} m/s, asked {crawls:.1f} m/s")
    return {
        "name": case.fault.name,
        "what": case.fault.what,
        "expected": case.then.value,
        "ok": not why,
        "why": "; ".join(why),
        "speed": round(happened.speed, 2),
        "shown": case.shows,
        "shown_after_s": shown_s,
        "sensors": happened.flagged,
        "causes": happened.causes,
        "stood_after_s": happened.stood_s,
        "way_m": round(happened.way_m, 2),
        "most_way_m": None if most_m is None else round(most_m, 2),
        "last_speed": round(happened.last, 2),
        "off_m": round(happened.off_m, 3),
        "most_off_m": case.off_m,
        "off_beyond_told_m": round(happened.lied_m, 3),
        "touched_at": round(happened.scraped, 2),
    }


def most_way(then: Then, speed: float, limits: Limits) -> float | None:
    """Return the longest way [m] in which a kart may stop, None where it need not."""
    if then is Then.STOPS:
        return SPARE * (speed * REACTION_S + speed**2 / (2.0 * limits.braking))
    if then is Then.HALTS:
        return SPARE * (speed * PATIENCE_S + speed**2 / (2.0 * GENTLE * limits.braking))
    return None
