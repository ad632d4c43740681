"""What clients receive of a scenario: its course, its rules, its reference line."""

from dataclasses import asdict
from typing import TYPE_CHECKING

import numpy as np

from race_server.core.vehicles import numbers_of
from race_server.net.wire.line import LineSheet
from race_server.net.wire.lobby import CourseSheet, Floats

if TYPE_CHECKING:
    # Scenarios import kernels, and so a compiler, which clients do not need.
    from race_server.scenario.race import Scenario


def course_sheet(scenario: "Scenario") -> CourseSheet:
    """Return the course and the size of its karts."""
    course, vehicle = scenario.course, scenario.vehicle_of(0)
    boxes = [(o.x, o.y, o.heading, o.length, o.width) for o in course.obstacles]
    return CourseSheet(
        name=course.name,
        title=course.title,
        digest=course.digest,
        spacing=course.spacing,
        line=course.line,
        half_widths=course.half_widths,
        kerb=course.kerb,
        borders=course.borders,
        gates=course.gates,
        grid=_grid_of(scenario),
        boxes=course.spots,
        grass=course.grass,
        obstacles=np.array(boxes).reshape(-1, 5),
        sectors=course.sectors,
        kart_length=vehicle.length,
        kart_width=vehicle.width,
        kart_ahead=vehicle.box_offset,
        slots=np.zeros((0, 5)) if course.lot is None else course.lot.slots,
    )


def _grid_of(scenario: "Scenario") -> Floats:
    """Return the places (S, 3) on the grid; row by row those of the seats, where they differ."""
    grid, order = scenario.course.grid, scenario.grid_order
    if not order:
        return grid
    free = [place for place in range(len(grid)) if place not in order] or [0]
    places = [place if place >= 0 else free[0] for place in order]
    return np.concatenate([grid[places], grid[free[1:]]])


# Of a vehicle's numbers those that decide on which arc it drives.
STEERED = ("front_axle", "rear_axle", "steering_limit")
# Among the rules that a server sends: whether the world waits for its drivers, and the vehicles'
# names, one for all or one for each seat, with commas between them.
LOCKSTEP, VEHICLES = "lockstep", "vehicles"


def rules_sheet(scenario: "Scenario") -> dict[str, str]:
    """Return the rule book and the size of a kart [m] as names and values.

    Of a vehicle with trailers also what decides where they go, by the names of `numbers_of`.
    """
    rules, vehicle = asdict(scenario.rules), scenario.vehicle_of(0)
    size = {"kart_length": vehicle.length, "kart_width": vehicle.width}
    if vehicle.trailers:
        size |= {
            name: value
            for name, value in numbers_of(vehicle).items()
            if name in STEERED or name.startswith("trailers.")
        }
    names = ",".join(vehicle.name for vehicle in scenario.vehicles)
    return {name: str(value) for name, value in (rules | size | {VEHICLES: names}).items()}


def line_sheet(scenario: "Scenario") -> LineSheet:
    """Return the reference line with its times, an empty one if there is none."""
    line = scenario.line
    if line is None:
        return LineSheet()
    # The time from one sample to the next at the mean of their speeds.
    steps = 2.0 * line.spacing / (line.speed + np.roll(line.speed, -1))
    ends = np.cumsum(steps)
    time = np.append(0.0, ends[:-1])
    return LineSheet(line.spacing, line.x, line.y, line.speed, time, float(ends[-1]), line.note)
