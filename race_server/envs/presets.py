"""Tasks to begin with: a race among all or among scripted karts, a time trial, parking."""

from dataclasses import replace
from typing import Any

from race_server.core.vehicle_presets import vehicle_named
from race_server.envs.parking import Parking
from race_server.envs.racing import Racing
from race_server.envs.task import Task
from race_server.scenario.parking import parking_scenario
from race_server.scenario.race import Rules, Scenario
from race_server.scenario.sensors import Lidar, Radar
from race_server.scenario.track.check import require_passable
from race_server.scenario.track.load import load_course

TRACK = "covapsy-train-2023"
# For learning there is no countdown; a kart that stands or drives backwards retires after a while.
LEARNING_RULES = Rules(
    laps=3,
    standing_start=True,
    countdown_s=0.0,
    stuck_s=0.0,
    stopped_limit_s=5.0,
    limit_s=300.0,
)


def scenario_on(
    track: str = TRACK,
    *,
    karts: int = 8,
    vehicle: str = "tt02",
    rules: Rules = LEARNING_RULES,
    lidar: Lidar | None = None,
    radar: Radar | None = None,
) -> Scenario:
    """Return a scenario for learning, with the sensors of a live race unless others are given.

    They give ten scans a second, so every other decision sees the scan of the decision before,
    in training as in a race.

    Raises:
        TrackError, VehicleError: one of them does not exist.
        ScenarioError: the vehicle does not fit through the course.
    """
    course, body = load_course(track), vehicle_named(vehicle)
    require_passable(course, body)
    return Scenario(
        course,
        karts=karts,
        vehicles=(body,),
        rules=rules,
        lidar=lidar or Lidar(),
        radar=radar or Radar(),
    )


def task_on(scenarios: tuple[Scenario, ...], **options: Any) -> Task:
    """Return a task of racing on these scenarios; options as for `Task` and `Racing`.

    Raises:
        TypeError: neither has an option of that name.
    """
    return Task(scenarios, Racing()).with_options(**options)


def race_task(
    track: str = TRACK,
    *,
    karts: int = 8,
    vehicle: str = "tt02",
    lidar: Lidar | None = None,
    radar: Radar | None = None,
    **options: Any,
) -> Task:
    """Return a race of three laps in which all karts learn; options as for `task_on`."""
    scenario = scenario_on(track, karts=karts, vehicle=vehicle, lidar=lidar, radar=radar)
    return task_on((scenario,), **{"reward": "race", **options})


def mixed_task(
    track: str = TRACK,
    *,
    karts: int = 8,
    learners: int = 1,
    vehicle: str = "tt02",
    lidar: Lidar | None = None,
    **options: Any,
) -> Task:
    """Return a race of `learners` among scripted karts; options as for `task_on`."""
    defaults: dict[str, Any] = {
        "reward": "race",
        "learners": learners,
        "opponents": ("avoider", "pure_pursuit", "follow_gap"),
    }
    scenario = scenario_on(track, karts=karts, vehicle=vehicle, lidar=lidar)
    return task_on((scenario,), **{**defaults, **options})


def time_trial_task(
    track: str = TRACK, *, vehicle: str = "tt02", lidar: Lidar | None = None, **options: Any
) -> Task:
    """Return one kart alone against the clock, from a random place; options as for `task_on`.

    A touch of a wall is a crash and ends the episode; so do 60 s.
    """
    rules = replace(
        LEARNING_RULES, laps=0, standing_start=False, items=False, wall_contact="retire"
    )
    defaults: dict[str, Any] = {
        "observation": ("lidar", "lidar_before", "speed", "steering"),
        "random_start": True,
        "most_steps": 1200,
    }
    scenario = scenario_on(track, karts=1, vehicle=vehicle, rules=rules, lidar=lidar)
    return task_on((scenario,), **{**defaults, **options})


def parking_task(
    lot: str = "yard-70",
    *,
    vehicles: int = 1,
    vehicle: str = "",
    level: str = "",
    limit_s: float = 0.0,
    **options: Any,
) -> Task:
    """Return vehicles that drive to slots of a lot; options as for `Task` and `Parking`.

    vehicle, level, limit_s: as the lot says, unless given. A decision takes 0.1 s.
    """
    scenario = parking_scenario(
        lot, vehicles=vehicles, vehicle=vehicle, level=level, limit_s=limit_s
    )
    defaults: dict[str, Any] = {
        "observation": "park",
        "action": "park",
        "reward": "park",
        "decision_ticks": 6,
    }
    return Task((scenario,), Parking()).with_options(**{**defaults, **options})
