"""A scenario: everything that is fixed before the first tick, and the world it makes."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from race_server.core import codes
from race_server.core.bounds import MOST_KARTS
from race_server.core.clock import ticks_of
from race_server.core.level import Level
from race_server.core.rules import edition
from race_server.core.rules.items import item_table
from race_server.core.stages.grid import line_up
from race_server.core.stages.lot_draw import draw_lot
from race_server.core.state import (
    RADAR_RAYS,
    Record,
    SensorData,
    World,
    empty_sightings,
    empty_world,
)
from race_server.core.vehicle_presets import TT02
from race_server.core.vehicles import Vehicle, vehicle_record
from race_server.errors import ScenarioError
from race_server.scenario.checked import check_whole
from race_server.scenario.level import level_named
from race_server.scenario.sensors import Lidar, Radar, fan, radar_fan, sensor_records
from race_server.scenario.track.course import Course
from race_server.scenario.track.line import ReferenceLine
from race_server.scenario.track.lots import make_parking
from race_server.scenario.track.route import pack_route
from race_server.scenario.track.walls import fence_of, pack_walls

# In place of the sensors of a kart, or of its place on the grid: it does not take part.
ABSENT = -1
# A tick that never comes.
NEVER = 2**62


@dataclass(frozen=True)
class Rules:
    """The rule book of one race. Times in seconds; zero switches a limit off."""

    laps: int = 3
    standing_start: bool = True
    countdown_s: float = 3.0
    wall_contact: str = "bump"  # bump or retire
    kart_contact: str = "bump"  # bump, retire or ghost
    restitution: float = 0.3
    wall_friction: float = 0.3
    items: bool = True
    catch_up: bool = True
    box_respawn_s: float = 5.0
    yellow_share: float = 0.4  # of the top speed under a yellow flag
    stuck_s: float = 3.0
    stuck_speed: float = 0.1  # [m/s]
    stopped_limit_s: float = 0.0  # a kart that stands longer without being blocked is removed
    wrong_way_lengths: float = 4.5  # kart lengths driven backwards before it is called so
    wrong_way_removal: float = 0.0  # [m] driven backwards after which a kart is removed
    ram_speed: float = 0.0  # [m/s] a harder blow from behind brings a warning
    ram_warnings: int = 3  # the kart is removed at this number
    false_start_penalty_s: float = 5.0
    short_cut_penalty_s: float = 5.0
    rescue_penalty_s: float = 5.0
    finish_limit_s: float = 100.0  # after the winner
    limit_s: float = 900.0
    edition: int = edition.NEWEST  # of the rule book as code, see `core/rules/edition.py`


@dataclass(frozen=True)
class Occasion:
    """What a race is of an event: an attempt, a heat, a final."""

    event: str  # its name, different for each event
    format: str  # the name of its format
    title: str  # of the attempt or race, different for each of the event


@dataclass(frozen=True)
class Scenario:
    """One race: where, who, and by which rules.

    line: along which drivers may race; see `race_server.scenario.raceline.attach`. level: how well
    a vehicle has to park, on a course with slots; as its lot says, unless given. occasion: of a
    race of an event.
    """

    course: Course
    karts: int = 8
    vehicles: tuple[Vehicle, ...] = (TT02,)  # one for all, or one for each kart
    rules: Rules = Rules()
    lidar: Lidar = field(default_factory=Lidar)
    radar: Radar = field(default_factory=Radar)
    fitted: tuple[int, ...] = (codes.LIDAR | codes.RADAR,)  # sensors; one for all, or one each
    seed: int = 0
    # Grid place of each kart, ABSENT for one that does not take part; empty: all, in order.
    grid_order: tuple[int, ...] = field(default=())
    line: ReferenceLine | None = None
    level: Level | None = None
    occasion: Occasion | None = None

    def vehicle_of(self, kart: int) -> Vehicle:
        """Return the vehicle of a kart."""
        return self.vehicles[kart % len(self.vehicles)]


def make_world(scenario: Scenario, seeds: Sequence[int] = ()) -> World:
    """Return the world of a scenario, every kart on its grid place.

    seeds: one world for each; without them a single world of the scenario's own seed.

    Raises:
        ScenarioError: the course has too few places, or a setting makes no race.
    """
    seeds = seeds or (scenario.seed,)
    return make_worlds([scenario] * len(seeds), seeds)


def make_worlds(scenarios: Sequence[Scenario], seeds: Sequence[int]) -> World:
    """Return one batch with a world for each scenario and seed.

    The scenarios may differ in all but the number of karts and their sensors; a kart that one of
    them does not want is fitted with ABSENT.

    Raises:
        ScenarioError: a course has too few places, a setting makes no race, or the scenarios
            do not fit into one batch.
    """
    first = scenarios[0]
    for scenario in scenarios:
        _check(scenario)
        if (scenario.karts, scenario.lidar, scenario.radar) != (
            first.karts,
            first.lidar,
            first.radar,
        ):
            raise ScenarioError("scenarios of one batch need the same number of karts and sensors")
    # A course is packed once for each reference line that is driven on it.
    lanes = list(dict.fromkeys((scenario.course, scenario.line) for scenario in scenarios))
    worlds = len(scenarios)
    most_boxes = 1 + max(len(one.trailers) for each in scenarios for one in each.vehicles)
    lots = [course.lot for course, _ in lanes]
    parking = make_parking(lots, worlds, first.karts, most_boxes)
    sight = SensorData(
        lidar=np.zeros((worlds, first.karts, 2, first.lidar.rays), np.float32),
        radar=np.zeros((worlds, first.karts, RADAR_RAYS), np.float32),
        radar_before=np.zeros((worlds, first.karts, RADAR_RAYS), np.float32),
        radar_kinds=np.zeros((worlds, first.karts, RADAR_RAYS), np.uint8),
        sightings=empty_sightings(parking),
        lidar_rays=fan(first.lidar.rays, first.lidar.field),
        radar_rays=radar_fan(first.radar),
    )
    world = empty_world(
        worlds,
        first.karts,
        max(len(course.spots) for course, _ in lanes),
        item_table(),
        sensor_records(first.lidar, first.radar),
        sight,
        pack_walls([fence_of(course) for course, _ in lanes]),
        pack_route([course for course, _ in lanes], [line for _, line in lanes]),
        parking,
    )
    for w, (scenario, seed) in enumerate(zip(scenarios, seeds, strict=True)):
        for k in range(scenario.karts):
            world.vehicles[w, k] = vehicle_record(scenario.vehicle_of(k))[0]
        _set_rules(world.rules[w], scenario, lanes.index((scenario.course, scenario.line)))
        line_up_race(world, w, scenario, seed)
    return world


def _check(scenario: Scenario) -> None:
    karts, course, rules = scenario.karts, scenario.course, scenario.rules
    check_whole("karts", karts, 1, MOST_KARTS)
    if scenario.grid_order:
        karts = 1 + max(scenario.grid_order)  # places that are needed
    if karts > len(course.grid) and not is_lot(course):
        raise ScenarioError(
            f"{karts} karts on {course.name}: its start grid has {len(course.grid)} places"
        )
    if course.lot is not None and is_lot(course):
        slots, wanted = course.lot.slot_count, karts * (2 if course.lot.from_slots else 1)
        if slots is not None and slots < wanted:
            raise ScenarioError(
                f"{karts} vehicles on {course.name}: it has {slots} slot{'s' * (slots != 1)}; two "
                "vehicles cannot share one"
                + (", and each needs one to start in" if course.lot.from_slots else "")
            )
    if rules.laps < 0:
        raise ScenarioError(f"{rules.laps} laps: choose 1 or more, or 0 for no limit")
    for policy in (rules.wall_contact, rules.kart_contact):
        if policy not in codes.CONTACT_POLICIES:
            known = ", ".join(codes.CONTACT_POLICIES)
            raise ScenarioError(f"contact policy {policy!r} is unknown; choose one of {known}")


def _set_rules(record: Record, scenario: Scenario, course: int) -> None:
    rules = scenario.rules
    vehicle = scenario.vehicle_of(0)
    record.laps = rules.laps
    record.course = course
    record.wall_contact = codes.CONTACT_POLICIES[rules.wall_contact]
    record.kart_contact = codes.CONTACT_POLICIES[rules.kart_contact]
    record.restitution, record.wall_friction = rules.restitution, rules.wall_friction
    record.items, record.catch_up = int(rules.items), int(rules.catch_up)
    record.standing_start = int(rules.standing_start)
    record.pick_up_radius = 0.5 * vehicle.width
    record.yellow_speed = rules.yellow_share * vehicle.top_speed
    record.stuck_speed = rules.stuck_speed
    record.wrong_way_limit = rules.wrong_way_lengths * vehicle.length
    record.wrong_way_removal = rules.wrong_way_removal
    record.ram_speed, record.ram_warnings = rules.ram_speed, rules.ram_warnings
    record.box_respawn_ticks = ticks_of(rules.box_respawn_s)
    record.stuck_ticks = ticks_of(rules.stuck_s)
    record.stopped_limit_ticks = ticks_of(rules.stopped_limit_s)
    record.finish_limit_ticks = ticks_of(rules.finish_limit_s)
    record.limit_ticks = ticks_of(rules.limit_s)
    record.false_start_us = round(rules.false_start_penalty_s * 1e6)
    record.short_cut_us = round(rules.short_cut_penalty_s * 1e6)
    record.rescue_us = round(rules.rescue_penalty_s * 1e6)
    record.edition = rules.edition


def line_up_race(world: World, w: int, scenario: Scenario, seed: int) -> None:
    """Put one world back to the start of its race, under a seed."""
    race = world.races[w]
    world.races[w] = np.zeros((), world.races.dtype)
    race.seed = seed
    race.start_tick = ticks_of(scenario.rules.countdown_s)
    world.event_counts[w] = 0
    world.hazards[w] = np.zeros((), world.hazards.dtype)
    world.boxes[w] = np.zeros((), world.boxes.dtype)
    spots = scenario.course.spots
    world.boxes["x"][w, : len(spots)] = spots[:, 0]
    world.boxes["y"][w, : len(spots)] = spots[:, 1]
    world.boxes["ready_tick"][w, len(spots) :] = NEVER
    sight = world.sight
    for seen in (sight.lidar, sight.radar, sight.radar_before, sight.radar_kinds):
        seen[w] = 0
    for k in range(scenario.karts):
        place = scenario.grid_order[k] if scenario.grid_order else k
        fitted = ABSENT if place == ABSENT else scenario.fitted[k % len(scenario.fitted)]
        _put_on_grid(world, w, k, place, fitted)
        _clear_parker(world, w, k, scenario)
    if is_lot(scenario.course):
        draw_lot(world, w)
        race.hold_until = race.start_tick  # without a line no start is judged
    line_up(world, w)


def _put_on_grid(world: World, w: int, k: int, place: int, fitted: int) -> None:
    for records in (world.bodies, world.racers, world.players):
        records[w, k] = np.zeros((), records.dtype)
    body, racer = world.bodies[w, k], world.racers[w, k]
    if fitted == ABSENT:
        return
    body.status = codes.RACING
    racer.grid_place = place
    body.sensors = fitted
    course = world.route.courses[world.rules[w].course]
    if course.grid_count > 0:
        body.x, body.y, body.heading = world.route.grid[course.grid_start + place]
        world.bodies["trailers"]["heading"][w, k] = body.heading


def _clear_parker(world: World, w: int, k: int, scenario: Scenario) -> None:
    """Set the tolerances of a vehicle that parks; whether it goes to a slot is still open."""
    if scenario.course.lot is not None:
        world.parking.parkers[w, k] = np.zeros((), world.parking.parkers.dtype)
        parker = world.parking.parkers[w, k]
        (scenario.level or level_named(scenario.course.lot.level)).fill(parker)


def is_lot(course: Course) -> bool:
    """Return whether a course is a car park alone: nothing to race along."""
    return course.lot is not None and not len(course.line)
