"""How fast the training world is through each of its interfaces, beside highway-env."""

from typing import Any

import numpy as np

from race_server.core.clock import SUBSTEPS
from race_server.core.driver import driver_named
from race_server.core.state import Floats
from race_server.core.suitability import suited
from race_server.envs.batch import Batch
from race_server.envs.buffers import REENTER
from race_server.envs.compatible.racetrack import RacetrackCompatible, racetrack_compatible_vector
from race_server.envs.parallel import KartRace
from race_server.envs.presets import race_task, scenario_on, task_on
from race_server.envs.single import time_trial
from race_server.scenario.highway import has_highway
from race_server.scenario.sensors import Lidar, Radar
from race_server.scenario.track.load import load_course
from race_server.tools.bench.core import profile
from race_server.tools.bench.rates import (
    batch_rate,
    is_over,
    ratio,
    replay_rate,
    state_times,
    vector_rate,
)

TRACK, VEHICLE, WORLDS, KARTS = "covapsy-train-2023", "tt02", 64, 8
LIDAR = ("lidar", "lidar_before", "speed", "steering")
# Sensors that are read at every decision: twice as often as in a race, the slowest case.
DECISION_HZ = 20
FRESH_SENSORS: dict[str, Any] = {
    "lidar": Lidar(period_s=1.0 / DECISION_HZ),
    "radar": Radar(period_s=1.0 / DECISION_HZ),
}

# Karts in all races together that `scaling` measures, on a course with a long grid.
CROWD, CROWDED_TRACK, CROWDED_VEHICLE = 512, "hangar-400", "kart-30"
KARTS_PER_RACE = (1, 2, 4, 8, 16, 32, 64)
WORLD_COUNTS = (1, 4, 16, 64, 256, 1024, 4096)  # the last are 320 MB of arrays
CORE_COUNTS = (1, 2)


def bench_env(*, cores: int = 1, seconds: float = 2.0) -> dict[str, Any]:
    """Return the figures of `race bench env`; those of highway-env are None without it."""
    ours = {
        "batch_radar": batch_rate(race_batch(cores=cores), driving, seconds),
        "batch_lidar": batch_rate(race_batch(LIDAR, cores=cores), driving, seconds),
        "pettingzoo_radar": _pettingzoo(seconds),
        "gym_lidar": _gymnasium(seconds),
        **_on_their_road(seconds),
    }
    yardstick, notes = _highway(seconds)
    figures = ours | yardstick
    pairs = (
        ("gym_lidar", "highway_lidar"),
        ("batch_lidar", "highway_lidar"),
        ("batch_radar", "highway_kinematics"),
        ("vector_grid", "highway_grid"),
        ("gym_grid", "highway_grid"),
    )
    return {
        "cores": cores,
        "clock": "CPU time" if cores == 1 else "wall time of the batches, CPU time of the others",
        **{name: value and round(value, 1) for name, value in figures.items()},
        "state": {
            f"{worlds}_worlds_{name}": round(spent, 2)
            for worlds in (1, WORLDS)
            for name, spent in state_times(race_batch(worlds=worlds)).items()
        },
        "ratios": {f"{a}_over_{b}": ratio(figures[a], figures[b]) for a, b in pairs},
        "learner_among_seven": _among_seven(seconds),
        "profile": _profile(),
        "notes": {
            "course": TRACK,
            "worlds": WORLDS,
            "karts": KARTS,
            "decision_hz": DECISION_HZ,
            "sensor_hz": DECISION_HZ,
            "lidar_rays": 201,
            "vector_grid": f"racetrack-v0 imported, {WORLDS} cars at once, its occupancy grid",
            **notes,
        },
    }


def driving(batch: Batch) -> Floats:
    """Return actions that keep every kart near the centre line, each at another speed."""
    world, learners = batch.world, batch.learners
    bodies, racers = world.bodies[:, :learners], world.racers[:, :learners]
    vehicles = world.vehicles[:, :learners]
    wheelbase = vehicles["front_axle"] + vehicles["rear_axle"]
    bend = world.route.line["curvature"][racers["line_index"]]
    aim = bend * wheelbase - 0.1 * racers["lateral_offset"] / wheelbase
    turn = aim - 0.5 * np.sin(racers["heading_error"])
    steering = np.arctan(turn) / vehicles["steering_limit"]
    pace = (0.15 + 0.002 * (np.arange(learners) % 8)) * vehicles["top_speed"]
    # Karts in a jam take turns to reverse.
    jammed = (racers["still_ticks"] > 60) & (world.races["tick"][:, None] % 120 < 60)
    drive = np.where(jammed, -1.0, pace - bodies["speed"])
    return np.clip(np.stack([drive, steering, np.ones_like(drive)], axis=-1), -1.0, 1.0)


def race_batch(
    observation: str | tuple[str, ...] = "radar", *, worlds: int = WORLDS, cores: int = 1
) -> Batch:
    """Return the batch of the main figures."""
    task = race_task(
        TRACK, karts=KARTS, observation=observation, random_start=True, **FRESH_SENSORS
    )
    return Batch(task, worlds=worlds, after=REENTER, threads=cores)


def crowded_batch(karts: int) -> Batch:
    """Return races of `karts` karts each, as many races as make up the crowd."""
    scenario = scenario_on(CROWDED_TRACK, karts=karts, vehicle=CROWDED_VEHICLE, **FRESH_SENSORS)
    task = task_on((scenario,), reward="race", random_start=True)
    return Batch(task, worlds=CROWD // karts, after=REENTER)


def _pettingzoo(seconds: float) -> float:
    """Measure one race of eight through dictionaries."""
    race = KartRace(race_task(TRACK, karts=KARTS, **FRESH_SENSORS))

    def act() -> dict[str, Any]:
        rows = driving(race.batch)[0].astype(np.float32)
        return {agent: rows[race.possible_agents.index(agent)] for agent in race.agents}

    # No kart finishes during the measurement, so that every step moves all agents.
    return KARTS * replay_rate(race, act, lambda _: len(race.agents) < KARTS, seconds)


def _gymnasium(seconds: float) -> float:
    """Measure one kart with lidar through Gymnasium's `step`."""
    env = time_trial(TRACK, lidar=FRESH_SENSORS["lidar"])

    def act() -> Any:
        return driving(env.batch)[0, 0].astype(np.float32)

    return replay_rate(env, act, is_over, seconds)


def _on_their_road(seconds: float) -> dict[str, float | None]:
    """Measure highway-env's race track in our batch, with its occupancy grid; None without it."""
    if not has_highway():
        return {"vector_grid": None, "gym_grid": None}
    many, one = racetrack_compatible_vector(WORLDS), RacetrackCompatible()
    return {
        "vector_grid": vector_rate(many, lambda: driving(many.cars.batch)[:, 0, 1:2], seconds),
        "gym_grid": replay_rate(one, lambda: driving(one.cars.batch)[0, 0, 1:2], is_over, seconds),
    }


def _highway(seconds: float) -> tuple[dict[str, float | None], dict[str, Any]]:
    """Return the figures of highway-env, None if it is not installed, and notes on them."""
    kinds = {
        "highway_lidar": "LidarObservation",
        "highway_kinematics": "Kinematics",
        "highway_grid": "",
    }
    figures: dict[str, float | None] = dict.fromkeys(kinds)
    if not has_highway():
        return figures, {}
    import gymnasium

    name = "racetrack-v1" if "racetrack-v1" in gymnasium.registry else "racetrack-v0"
    settings: dict[str, Any] = {}
    for figure, kind in kinds.items():
        # The grid is what it shows by default.
        wanted = {"observation": {"type": kind}} if kind else {}
        env: Any = gymnasium.make(name, config=wanted, disable_env_checker=True).unwrapped
        figures[figure] = _one_highway(env, seconds)
        settings = env.config
        env.close()
    frequencies = ("policy_frequency", "simulation_frequency")
    notes = {f"highway_{key}_hz": settings[key] for key in frequencies}
    return figures, {"highway_environment": name, **notes, "highway_agents": 1}


def _one_highway(env: Any, seconds: float) -> float:
    """Measure highway-env's `step`, with its car kept on the road as ours are."""

    def act() -> Any:
        car = env.vehicle
        along, aside = car.lane.local_coordinates(car.position)
        turn = car.lane.heading_at(along + 2.0) - car.heading
        turn = (turn + np.pi) % (2.0 * np.pi) - np.pi
        return np.clip([turn - 0.1 * aside], -1.0, 1.0)

    return replay_rate(env, act, is_over, seconds)


def _among_seven(seconds: float) -> dict[str, float]:
    """Return decisions per second of one learner among seven karts of each compiled driver."""
    names = [name for name in suited(VEHICLE) if hasattr(driver_named(name), "decide_all")]
    tasks = {name: race_task(TRACK, karts=KARTS, learners=1, opponents=(name,)) for name in names}
    return {
        name: round(batch_rate(Batch(task, worlds=WORLDS, after=REENTER), driving, seconds))
        for name, task in tasks.items()
    }


def _profile() -> dict[str, float]:
    """Return CPU nanoseconds per ray, per contact search and per substep, for one kart."""
    parts = profile(load_course(TRACK))
    substeps = 3 * SUBSTEPS
    return {
        "radar_ns_per_ray": parts["radar_ns_per_ray"],
        "lidar_ns_per_ray": parts["lidar_ns_per_ray"],
        "kart_contact_ns": round(parts["kart_contacts_ns"] / substeps, 1),
        "wall_contact_ns": parts["wall_contact_ns_per_substep"],
        "motion_ns_per_substep": parts["motion_ns_per_substep"],
    }


def bench_scaling(*, seconds: float = 0.5) -> dict[str, Any]:
    """Return agent-steps per second against karts per race, worlds and cores."""

    def on(batch: Batch) -> int:
        return round(batch_rate(batch, driving, seconds))

    kinds: dict[str, str | tuple[str, ...]] = {"radar": "radar", "lidar": LIDAR}
    return {
        "karts_per_race": {str(karts): on(crowded_batch(karts)) for karts in KARTS_PER_RACE},
        "worlds": {str(worlds): on(race_batch(worlds=worlds)) for worlds in WORLD_COUNTS},
        "cores": {
            kind: {str(cores): on(race_batch(seen, cores=cores)) for cores in CORE_COUNTS}
            for kind, seen in kinds.items()
        },
    }
