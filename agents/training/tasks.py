"""Tasks of the training world from settings: one to learn, one for each evaluation.

A course is a track that is raced on, or a lot that is parked in.
"""

from dataclasses import fields, replace
from typing import Any, NamedTuple

from race_agents.training.settings import Range, Settings
from race_server.core.vehicle_presets import vehicle_named
from race_server.core.vehicles import Vehicle
from race_server.envs.parking import Parking
from race_server.envs.presets import LEARNING_RULES, task_on
from race_server.envs.task import Task
from race_server.errors import ScenarioError
from race_server.scenario.lot.nearer import at_distance
from race_server.scenario.parking import LOT_RULES, parking_scenario
from race_server.scenario.race import ABSENT, Rules, Scenario
from race_server.scenario.sensors import Lidar
from race_server.scenario.track.check import require_passable
from race_server.scenario.track.sets import course_named, names_of


class Choice(NamedTuple):
    """What a reset may draw: a course, a vehicle, how far from the slot it starts, the karts."""

    course: str
    distance: Range | None  # [m]; None: as the lot has it
    karts: int
    vehicle: str
    has_items: bool  # as the rules say; False: none


def courses_of(settings: Settings) -> tuple[str, ...]:
    """Return the names of the tracks or lots to learn on."""
    if settings.parks:
        return settings.parking.lots
    return names_of(settings.tracks.names, settings.tracks.set)


def validation_courses(settings: Settings) -> tuple[str, ...]:
    """Return the names of the courses on which the best moment of a training is chosen."""
    tried = settings.evaluation
    if settings.parks:
        return tried.lots or settings.parking.lots
    return names_of(tried.tracks.names, tried.tracks.set)


def final_courses(settings: Settings) -> tuple[str, ...]:
    """Return the names of the courses on which the best policy is evaluated at the end."""
    tried = settings.evaluation
    if settings.parks:
        return tried.final_lots or validation_courses(settings)
    return names_of(tried.final.names, tried.final.set)


def choices_of(settings: Settings) -> tuple[Choice, ...]:
    """Return what a reset may draw, in the order of the scenarios of the task to learn."""
    asked = [stage.distance for stage in settings.curriculum]
    distances = tuple(dict.fromkeys(asked)) if settings.parks and asked else (None,)
    return tuple(
        Choice(name, distance, karts, vehicle, has_items)
        for name in courses_of(settings)
        for distance in distances
        for karts in settings.race.sizes
        for vehicle in (settings.vehicle, *settings.more_vehicles)
        for has_items in ((True, False) if settings.race.half_without_items else (True,))
    )


def training_task(settings: Settings) -> Task:
    """Return the task to learn, with all its tracks or lots.

    Raises:
        RaceError: a track, a lot, a vehicle or a rule does not exist.
    """
    scenarios = tuple(
        _with_items(
            _with_karts(
                _scenario(settings, choice.course, choice.vehicle, choice.distance),
                choice.karts,
                settings.race.learners,
            ),
            choice.has_items,
        )
        for choice in choices_of(settings)
    )
    drawing = [one.vehicle_of(0) for one in scenarios if one.vehicle_of(0).trailers]
    if settings.evades and drawing:
        raise ScenarioError(
            f"evades = true with vehicle = {drawing[0].name!r}: it is reckoned for one body, "
            "without trailers; leave it out"
        )
    return _task(settings, scenarios)


def _with_items(scenario: Scenario, has_items: bool) -> Scenario:
    """Return a scenario as its rules say, or one without items."""
    rules = scenario.rules
    return scenario if has_items else replace(scenario, rules=replace(rules, items=False))


def _with_karts(scenario: Scenario, karts: int, learners: int) -> Scenario:
    """Return a scenario with only the first karts, learners always among them."""
    if not learners <= karts <= scenario.karts:
        raise ScenarioError(
            f"race.fields: {karts} karts, with race.karts = {scenario.karts} and race.learners = "
            f"{learners}; choose {learners} to {scenario.karts}"
        )
    away = (ABSENT,) * (scenario.karts - karts)
    return replace(scenario, fitted=scenario.fitted * karts + away) if away else scenario


def evaluation_tasks(settings: Settings, courses: tuple[str, ...]) -> dict[str, Task]:
    """Return a task for each course of an evaluation: from a start grid, or anywhere in a lot.

    In a lot a touch ends an episode there, whatever `race.rules` says of those to learn from.

    Raises:
        RaceError: a course does not exist.
    """
    if settings.parks:
        lots = {
            name: _task(settings, (_ending_by_touch(_scenario(settings, name, settings.vehicle)),))
            for name in courses
        }
        return {name: task.with_options(most_steps=0) for name, task in lots.items()}
    steps = round(settings.evaluation.seconds / settings.decision_s)
    return {
        name: _task(
            settings, (_from_the_middle(_scenario(settings, name, settings.vehicle)),)
        ).with_options(random_start=False, most_steps=steps)
        for name in courses
    }


def _ending_by_touch(scenario: Scenario) -> Scenario:
    """Return a scenario in which a touch ends the way of a vehicle, as in an exam of parking."""
    touches = {name: getattr(LOT_RULES, name) for name in ("wall_contact", "kart_contact")}
    return replace(scenario, rules=replace(scenario.rules, **touches))


def _from_the_middle(scenario: Scenario) -> Scenario:
    """Return a scenario in which the first kart does not start first, so that it has to pass."""
    karts = scenario.karts
    order = tuple((kart + karts // 2) % karts for kart in range(karts))
    return replace(scenario, grid_order=order)


def _task(settings: Settings, scenarios: tuple[Scenario, ...]) -> Task:
    race, episode = settings.race, settings.episode
    options: dict[str, Any] = {
        "opponents": race.opponents
        or (settings.self_play.anchors if settings.self_play.seats else ()),
        "learners": race.learners,
        "observation": settings.observation,
        "action": settings.action,
        "base": settings.base,
        "reward": settings.reward,
        "gap": settings.gap,
        "decision_ticks": settings.decision_ticks,
        "most_steps": episode.steps,
        "simulator": settings.simulator,
    }
    if settings.parks:
        asked = settings.parking
        parking = Parking(
            asked.late_ends, asked.heuristic, asked.shaping, settings.gamma, asked.team
        )
        return Task(scenarios, parking).with_options(**options)
    return task_on(
        scenarios,
        **options,
        random_start=episode.random_start,
        random_grid=episode.random_grid,
        crash_range=episode.crash_range,
    )


def _scenario(
    settings: Settings, name: str, vehicle: str, distance: Range | None = None
) -> Scenario:
    """Return a scenario on a track, or in a lot with starts at a distance [m] from the slot."""
    lidar = settings.lidar
    sensor = Lidar(rays=lidar.rays, noise=lidar.noise, dropout=lidar.dropout)
    if settings.parks:
        return replace(_parking_scenario(settings, name, vehicle, distance), lidar=sensor)
    course, vehicles = course_named(name), _vehicles(settings, vehicle)
    for one in vehicles:
        require_passable(course, one)
    return Scenario(
        course,
        karts=settings.race.karts,
        vehicles=vehicles,
        rules=_rules(settings.race.rules, LEARNING_RULES),
        lidar=sensor,
    )


def _vehicles(settings: Settings, vehicle: str) -> tuple[Vehicle, ...]:
    """Return one vehicle for all karts, or one for each where policies have their own."""
    names = [one.vehicle or vehicle for one in settings.policies for _ in range(one.karts)]
    names += [vehicle] * (settings.race.karts - len(names))
    if set(names) == {vehicle}:
        names = names[:1]
    return tuple(vehicle_named(name) for name in names)


def _parking_scenario(
    settings: Settings, name: str, vehicle: str, distance: Range | None
) -> Scenario:
    asked = settings.parking
    scenario = parking_scenario(
        name,
        vehicles=settings.race.karts,
        vehicle=vehicle,
        level=asked.level,
        limit_s=asked.limit_s,
    )
    scenario = replace(scenario, rules=_rules(settings.race.rules, scenario.rules))
    if distance is None:
        return scenario
    return replace(scenario, course=at_distance(scenario.course, distance))


def _rules(words: dict[str, Any], usual: Rules) -> Rules:
    kinds = {field.name: type(getattr(usual, field.name)) for field in fields(Rules)}
    for key, value in words.items():
        if key not in kinds:
            raise ScenarioError(
                f"race.rules.{key} = {value!r}: no such rule; known are {', '.join(kinds)}"
            )
        fits = isinstance(value, kinds[key]) or (kinds[key] is float and isinstance(value, int))
        if not fits:
            raise ScenarioError(f"race.rules.{key} = {value!r}: give a {kinds[key].__name__}")
    return replace(usual, **words)
