"""How fast car parks are through each interface, beside highway-env's parking."""

import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import gymnasium
import numpy as np

from race_server.core.state import Floats
from race_server.envs.batch import Batch
from race_server.envs.buffers import RESET_WORLD
from race_server.envs.compatible.parking import ParkCompatible, park_compatible_vector
from race_server.envs.parallel import parallel_lot
from race_server.envs.parking.single import park_goal
from race_server.envs.presets import parking_task
from race_server.envs.registration import PARK_COMPATIBLE
from race_server.scenario.highway import has_highway
from race_server.tools.bench.rates import batch_rate, is_over, ratio, replay_rate, vector_rate

WORLDS, VEHICLES = 64, 8
OPEN, YARD, GATE, ROWS = "zone-30", "yard-70", "gate", "grid-150"
PACE = 1.0  # [m/s]
RESETS = 50

# Names of figures of highway-env, and of its environments.
PARKING, FULL_PARKING = "highway_parking", "highway_parking_with_cars"
THEIRS = {PARKING: "parking-v0", FULL_PARKING: "parking-parked-v0"}


def bench_lot(*, seconds: float = 2.0) -> dict[str, Any]:
    """Return the figures of `race bench lot`; those of highway-env are None without it.

    All are decisions of one vehicle a second of CPU time of one core, resets included.
    """
    ours: dict[str, float | None] = {
        "batch_open": batch_rate(_batch(OPEN, "report_a_1"), towards_slots, seconds),
        "batch_yard": batch_rate(_batch(YARD, "park"), towards_slots, seconds),
        "batch_lorry": batch_rate(_full_rows(), out_of_slots, seconds),
        "gym_goal": _gymnasium(seconds),
        "pettingzoo": _pettingzoo(seconds),
        **_compatible(seconds),
    }
    figures = ours | {name: _highway(name, seconds) for name in THEIRS}
    pairs = (
        ("batch_open", PARKING),
        ("batch_yard", FULL_PARKING),
        ("gym_goal", PARKING),
        ("pettingzoo", PARKING),
        ("vector_compatible", PARKING),
        ("gym_compatible", PARKING),
    )
    return {
        **{name: value and round(value, 1) for name, value in figures.items()},
        "ratios": {f"{a}_over_{b}": ratio(figures[a], figures[b]) for a, b in pairs},
        "reset_us": {lot: round(_reset_us(lot), 1) for lot in (OPEN, YARD, "aisle-90", ROWS)},
        "notes": {
            "clock": "CPU time",
            "worlds": WORLDS,
            "decision_hz": 10,
            "batch_open": f"{OPEN}, no obstacles, no rays",
            "batch_yard": f"{YARD}, 6 to 10 blocks, a person, 9 rays",
            "batch_lorry": f"{ROWS}, a lorry, all other slots taken, 14 feelers",
            "gym_goal": f"Kart/ParkGoal-v0 in {OPEN}, dictionaries",
            "vector_compatible": f"{PARK_COMPATIBLE}, {WORLDS} at once, new ways included",
            "gym_compatible": f"{PARK_COMPATIBLE}, random actions as {THEIRS[PARKING]}",
            "pettingzoo": f"Kart/Lot-v0, {VEHICLES} vehicles in {GATE}",
        },
    }


def towards_slots(batch: Batch) -> Floats:
    """Return actions that drive every vehicle straight towards its slot at a steady pace."""
    bodies, parkers = batch.world.bodies, batch.world.parking.parkers
    bearing = np.arctan2(parkers["y"] - bodies["y"], parkers["x"] - bodies["x"])
    turn = np.sin(bearing - bodies["heading"])
    return np.stack([PACE - bodies["speed"], turn], axis=-1).clip(-1.0, 1.0)


def out_of_slots(batch: Batch) -> Floats:
    """Return actions that drive every vehicle straight ahead at a steady pace, with some play."""
    bodies = batch.world.bodies
    steering = 0.1 * np.sin(0.1 * bodies["x"] + bodies["y"])
    return np.stack([PACE - bodies["speed"], steering], axis=-1).clip(-1.0, 1.0)


def _full_rows() -> Batch:
    """Return lorries in a car park in which 106 vehicles stand."""
    task = parking_task(ROWS, observation="report_c", reward="report_c")
    (scenario,) = task.scenarios
    assert scenario.course.lot is not None
    taken = replace(scenario.course.lot.taken, share=1.0)
    course = replace(scenario.course, lot=replace(scenario.course.lot, taken=taken))
    task = replace(task, scenarios=(replace(scenario, course=course),))
    return Batch(task, worlds=WORLDS, after=RESET_WORLD)


def _batch(lot: str, observation: str) -> Batch:
    task = parking_task(lot, observation=observation)
    return Batch(task, worlds=WORLDS, after=RESET_WORLD)


def _gymnasium(seconds: float) -> float:
    """Measure one vehicle through Gymnasium's `step`, with goals in dictionaries."""
    env = park_goal(OPEN)

    def act() -> Any:
        return towards_slots(env.kart.batch)[0, 0].astype(np.float32)

    return replay_rate(env, act, is_over, seconds)


def _pettingzoo(seconds: float) -> float:
    """Measure vehicles of one lot through PettingZoo's dictionaries, while all still drive."""
    lot = parallel_lot(GATE, vehicles=VEHICLES)

    def act() -> dict[str, Any]:
        rows = towards_slots(lot.batch)[0].astype(np.float32)
        return {agent: rows[lot.possible_agents.index(agent)] for agent in lot.agents}

    return VEHICLES * replay_rate(lot, act, lambda _: len(lot.agents) < VEHICLES, seconds)


def _compatible(seconds: float) -> dict[str, float | None]:
    """Measure the car park with highway-env's interface, under random actions as there."""
    many, one = park_compatible_vector(WORLDS), ParkCompatible()
    many.action_space.seed(0)
    one.action_space.seed(0)
    return {
        "vector_compatible": vector_rate(many, many.action_space.sample, seconds),
        "gym_compatible": replay_rate(one, one.action_space.sample, is_over, seconds),
    }


def _reset_us(lot: str) -> float:
    """Return the CPU time of a new round of one world [us]."""
    batch = _batch(lot, "park")
    batch.reset(0)
    begun = time.process_time()
    for seed in range(RESETS):
        batch.reset(seed)
    spent = time.process_time() - begun
    batch.close()
    return spent / RESETS / WORLDS * 1e6


def _highway(figure: str, seconds: float) -> float | None:
    """Return steps per second of an environment of highway-env under random actions."""
    if not has_highway():
        return None
    env: Any = gymnasium.make(THEIRS[figure], disable_env_checker=True).unwrapped
    env.action_space.seed(0)
    act: Callable[[], Any] = env.action_space.sample
    try:
        return replay_rate(env, act, is_over, seconds)
    finally:
        env.close()
