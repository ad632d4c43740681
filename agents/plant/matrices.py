"""The matrices of meetings, and what they come to."""

import math
from collections.abc import Callable, Iterator, Sequence
from functools import partial

import numpy as np

from race_agents.plant.encounter import (
    ADULT,
    BRAKES,
    CHILD,
    DRIVES,
    FOLLOWS,
    HASTES,
    KMH,
    PARKED_ASIDE,
    WALKS,
    Case,
    Outcome,
    meet,
)
from race_agents.plant.moves import brakes, crosses, goes_ahead
from race_agents.plant.points import MATRICES, Cell, calculator, points_of
from race_agents.plant.radar import ERRS
from race_agents.plant.row import Row
from race_agents.plant.sensors import Sensors
from race_agents.plant.whereabouts import Setting
from race_server.core.vehicles import Vehicle

SPEEDS = tuple(speed * KMH for speed in (10, 20, 30, 40, 50, 60))
SHARES = (0.10, 0.25, 0.50, 0.75, 0.90)  # of the width, where who crosses would be hit
ASIDE = (1.0, 1.5, 2.0)  # [m] beside the body's way
TO_50 = tuple(speed * KMH for speed in (20, 30, 40, 50))
# Full braking of a kart as its figures promise, and the time until it bites.
BOUND_BRAKING, BOUND_DELAY_S = 6.5, 0.1
# Of the points that any brake could get, so much is asked in the standard and the extended range.
STANDARD_SHARE, EXTENDED_SHARE = 0.95, 0.9


def people(vehicle: Vehicle) -> Iterator[Case]:
    """Yield the meetings with people."""
    width, parked = vehicle.width, parked_beside(vehicle)
    for speed in SPEEDS:
        for share in (0.25, 0.5):
            at = (share - 0.5) * width
            walks = partial(goes_ahead, pace=WALKS, at=at, x=ADULT)
            yield Case("CPLA", speed, walks, share=share)
        for share in SHARES:
            at = (share - 0.5) * width
            near = partial(crosses, pace=WALKS, side=-1.0, at=at, x=ADULT)
            far = partial(crosses, pace=HASTES, side=1.0, at=-at, x=ADULT)
            child = partial(crosses, pace=WALKS, side=-1.0, at=at, x=CHILD)
            yield Case("CPNA", speed, near, share=share)
            yield Case("CPFA", speed, far, share=share)
            yield Case("CPNCO", speed, child, CHILD, parked, share=share)


def parked_beside(vehicle: Vehicle) -> tuple[tuple[float, float], ...]:
    """Return the middles x, y [m] of two karts that are parked to the right, before the meeting."""
    y = -(0.5 * vehicle.width + PARKED_ASIDE + 0.5 * vehicle.width)
    return (-0.5 * vehicle.length - 0.3, y), (-1.5 * vehicle.length - 0.8, y)


def karts(vehicle: Vehicle) -> Iterator[Case]:
    """Yield the meetings with karts ahead."""
    half = 0.5 * vehicle.length
    for speed in SPEEDS:
        yield Case("CCRs", speed, partial(goes_ahead, pace=0.0, at=0.0, x=half), None)
        if speed > DRIVES + 1.0:
            yield Case("CCRm", speed, partial(goes_ahead, pace=DRIVES, at=0.0, x=half), None)
        slows = partial(brakes, speed=speed, length=vehicle.length, follows=FOLLOWS, braking=BRAKES)
        yield Case("CCRb", speed, slows, None)


def bystanders(vehicle: Vehicle) -> Iterator[Case]:
    """Yield meetings without danger: people beside the way, and those that have left it."""
    for speed in TO_50:
        for aside in ASIDE:
            y = 0.5 * vehicle.width + aside + ADULT
            yield Case("stands beside", speed, partial(goes_ahead, pace=0.0, at=y, x=0.0))
            gone = partial(crosses, pace=WALKS, side=-1.0, at=y + 2.0 * WALKS, x=0.0)
            yield Case("has left", speed, gone)


def rows(setting: Setting) -> list[Row]:
    """Return the table of the meetings, a radar that errs, some karts as built."""
    vehicle, sensors, builds = setting.vehicle, Sensors(radar=ERRS), min(setting.seeds, 3)

    def outcomes(
        cases: Sequence[Case], badness: Callable[[Outcome], float]
    ) -> list[tuple[Case, Outcome]]:
        """Return the worst of some karts as built, for each case."""
        result = []
        for case in cases:
            tries = [meet(case, vehicle, sensors, seed) for seed in range(builds)]
            setting.tell()
            result.append((case, max(tries, key=badness)))
        return result

    met = outcomes([*people(vehicle), *karts(vehicle)], lambda each: each.impact or 0.0)
    aside = outcomes([*bystanders(vehicle)], lambda each: -each.braked_s)
    result = []
    for name in ("CPLA", "CPNA", "CPFA", "CPNCO", "CCRs", "CCRm", "CCRb"):
        mine = [each for each in met if each[0].name == name]
        hit = [outcome for _, outcome in mine if outcome.impact is not None]
        worst = max((outcome.impact or 0.0 for outcome in hit), default=0.0)
        bound = 1.0 - (_unavoidable(vehicle) if name == "CPNCO" else 0.0)
        result.append(
            Row(
                f"{name}: avoided, 10 to 60 km/h",
                "share",
                1.0 - len(hit) / len(mine),
                least=0.9 * bound,
                note=f"no brake can avoid more than {bound:.2f}; "
                f"worst impact {worst / KMH:.0f} km/h",
            )
        )
    if calculator() is not None:
        result += [_points(name, met, vehicle) for name in MATRICES]
    visible = [each for each in met if each[0].name != "CPNCO"]
    leads = [outcome.lead_s for _, outcome in visible if math.isfinite(outcome.braked_s)]
    early = float(np.mean([lead >= 0.8 for lead in leads])) if leads else 0.0
    result.append(
        Row("warned 0.8 s before full brakes, where it was visible", "share", early, least=1.0)
    )
    braked = sum(math.isfinite(outcome.braked_s) for _, outcome in aside)
    result.append(
        Row("full brakes for people 1 m beside, or that left", "of all", braked, most=0.0)
    )
    return result


def _points(name: str, met: Sequence[tuple[Case, Outcome]], vehicle: Vehicle) -> Row:
    """Return the points of a matrix by the public calculator, beside what any brake could get."""
    mine = [each for each in met if each[0].name == name]
    points = points_of(name, {_cell(case): (got.impact or 0.0) / KMH for case, got in mine})
    bound = points_of(name, {_cell(case): _least_impact(case, vehicle) / KMH for case, _ in mine})
    return Row(
        f"{name}: points of its {points.cells} cells, by {calculator()}",
        f"of {points.most_standard + points.most_extended:g}",
        points.total,
        least=STANDARD_SHARE * bound.standard + EXTENDED_SHARE * bound.extended,
        note=f"standard {points.standard:g}, extended {points.extended:g}; no brake could get more "
        f"than {bound.standard:g} and {bound.extended:g}. Shapes of the protocol, no rating",
    )


def _cell(case: Case) -> Cell:
    return round(case.speed / KMH), round(100.0 * case.share)


def _least_impact(case: Case, vehicle: Vehicle) -> float:
    """Return the speed at which the best brake would hit who steps out, 0 where it would not [m/s].

    A target that is not hidden is seen in time at these speeds.
    """
    if case.name != "CPNCO":
        return 0.0
    room = case.speed * (_seen_s(case.share, vehicle) - BOUND_DELAY_S)
    return math.sqrt(max(case.speed**2 - 2.0 * BOUND_BRAKING * room, 0.0))


def _seen_s(share: float, vehicle: Vehicle) -> float:
    """Return for how long a child is seen that comes from behind a parked kart [s]."""
    return (PARKED_ASIDE + share * vehicle.width) / WALKS


def _unavoidable(vehicle: Vehicle) -> float:
    """Return which share of the children from behind a parked kart no brake can avoid."""
    hits = [
        BOUND_DELAY_S + 0.5 * speed / BOUND_BRAKING > _seen_s(share, vehicle)
        for speed in SPEEDS
        for share in SHARES
    ]
    return sum(hits) / len(hits)
