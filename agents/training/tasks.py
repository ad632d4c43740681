"""Tasks of the training world from settings: one to learn, one for each evaluation."""

from dataclasses import fields, replace
from typing import Any

from race_agents.training.settings import Settings, Tracks
from race_server.core.vehicles import vehicle_named
from race_server.envs.presets import LEARNING_RULES, task_on
from race_server.envs.task import Task
from race_server.errors import ScenarioError
from race_server.scenario.race import ABSENT, Rules, Scenario
from race_server.scenario.sensors import Lidar
from race_server.scenario.track.sets import course_named, names_of

DECISION_TICKS = 3  # as in a live race


def training_task(settings: Settings) -> Task:
    """Return the task to learn, with all its tracks.

    Raises:
        RaceError: a track, a vehicle or a rule does not exist.
    """
    scenarios = tuple(
        _with_karts(_scenario(settings, name), karts, settings.race.learners)
        for name in names_of(settings.tracks.names, settings.tracks.set)
        for karts in settings.race.sizes
    )
    return _task(settings, scenarios)


def _with_karts(scenario: Scenario, karts: int, learners: int) -> Scenario:
    """Return a scenario with only the first karts, learners always among them."""
    if not learners <= karts <= scenario.karts:
        raise ScenarioError(
            f"race.fields: {karts} karts, with race.karts = {scenario.karts} and race.learners = "
            f"{learners}; choose {learners} to {scenario.karts}"
        )
    away = (ABSENT,) * (scenario.karts - karts)
    return replace(scenario, fitted=scenario.fitted * karts + away) if away else scenario


def evaluation_tasks(settings: Settings, tracks: Tracks) -> dict[str, Task]:
    """Return a task for each track of an evaluation, from its start grid.

    Raises:
        RaceError: a track does not exist.
    """
    steps = round(settings.evaluation.seconds / decision_s())
    return {
        name: _task(settings, (_from_the_middle(_scenario(settings, name)),)).with_options(
            random_start=False, most_steps=steps
        )
        for name in names_of(tracks.names, tracks.set)
    }


def _from_the_middle(scenario: Scenario) -> Scenario:
    """Return a scenario in which the first kart does not start first, so that it has to pass."""
    karts = scenario.karts
    order = tuple((kart + karts // 2) % karts for kart in range(karts))
    return replace(scenario, grid_order=order)


def decision_s() -> float:
    """Return the time between two decisions [s]."""
    return DECISION_TICKS / 60.0


def _task(settings: Settings, scenarios: tuple[Scenario, ...]) -> Task:
    race, episode = settings.race, settings.episode
    return task_on(
        scenarios,
        opponents=race.opponents
        or (settings.self_play.anchors if settings.self_play.seats else ()),
        learners=race.learners,
        observation=settings.observation,
        action=settings.action,
        base=settings.base,
        reward=settings.reward,
        gap=settings.gap,
        decision_ticks=DECISION_TICKS,
        most_steps=episode.steps,
        random_start=episode.random_start,
        random_grid=episode.random_grid,
        crash_range=episode.crash_range,
    )


def _scenario(settings: Settings, name: str) -> Scenario:
    lidar = settings.lidar
    return Scenario(
        course_named(name),
        karts=settings.race.karts,
        vehicles=(vehicle_named(settings.vehicle),),
        rules=_rules(settings.race.rules),
        lidar=Lidar(rays=lidar.rays, noise=lidar.noise, dropout=lidar.dropout),
    )


def _rules(words: dict[str, Any]) -> Rules:
    kinds = {field.name: type(getattr(LEARNING_RULES, field.name)) for field in fields(Rules)}
    for key, value in words.items():
        if key not in kinds:
            raise ScenarioError(
                f"race.rules.{key} = {value!r}: no such rule; known are {', '.join(kinds)}"
            )
        fits = isinstance(value, kinds[key]) or (kinds[key] is float and isinstance(value, int))
        if not fits:
            raise ScenarioError(f"race.rules.{key} = {value!r}: give a {kinds[key].__name__}")
    return replace(LEARNING_RULES, **words)
