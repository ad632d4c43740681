"""The second simulator: highway-env's `parking-v0`, its criterion and ours.

A car of 5 by 2 m on a kinematic single-track model of 5 m wheelbase, five decisions a second,
3 physical steps each; 28 slots of 8 by 4 m (https://github.com/Farama-Foundation/HighwayEnv).
"""

from collections.abc import Callable
from statistics import median
from typing import Any

import numpy as np
from numpy.typing import NDArray

from race_agents.reproductions.exam import FIRST_SEED
from race_server.envs.parking.goal import METRES, is_reached
from race_server.scenario.highway import make_highway
from race_server.scenario.level import level_named

Array = NDArray[Any]
Act = Callable[[Any], Any]  # from what `parking-v0` shows to pedal and steering, both -1 to 1

NAME = "parking-v0"
DECISION_S = 0.2
LIMIT_S = 60.0  # instead of its 100 s, as in our lots
SHARE = 10  # of the starts of an exam one is driven: a decision takes milliseconds
GRACE_S = 10.0  # for which an exam goes on after its success, which asks for less than ours
WHEELBASE = 5.0  # [m]
STEERING_LIMIT = float(np.radians(45.0))
ACCELERATION = 5.0  # [m/s²] of a full pedal


def make_parking_v0() -> Any:
    """Return the environment, which ends with its success, a crash, or after a minute.

    Raises:
        ScenarioError: highway-env is not installed.
    """
    return make_highway(NAME, duration=LIMIT_S)


def goals_in(env: Any) -> tuple[Array, Array]:
    """Return where the car is and where its slot is, as goals (5,) of `GoalView` [m/s for 1]."""
    car = env.unwrapped.vehicle

    def goal(place: Any, heading: float, speed: float) -> Array:
        x, y = np.asarray(place) / METRES
        return np.array([x, y, np.cos(heading), np.sin(heading), speed])

    slot = car.goal
    return goal(car.position, car.heading, car.speed), goal(slot.position, slot.heading, 0.0)


def examine_there(env: Any, begin: Callable[[], None], act: Act, starts: int) -> dict[str, Any]:
    """Park from each start once, and return figures; shares are told as counts.

    begin: called before each way. It is judged at its decisions: by its own criterion until the way
    ends, by ours for 10 s more.
    """
    counts = dict.fromkeys(("own", "goal", "parked", "crash"), 0)
    times = []
    for number in range(starts):
        begin()
        met, own_s = _drive(env, act, FIRST_SEED + number)
        for name in met:
            counts[name] += 1
        if own_s is not None:
            times.append(own_s)
    return {"starts": starts, **counts, "time_s": median(times) if times else None}


def _drive(env: Any, act: Act, seed: int) -> tuple[set[str], float | None]:
    """Return what a way has met, and when [s] it was first a success by its own criterion."""
    goal, parked = level_named("goal"), level_named("parked")
    seen, _ = env.reset(seed=seed)
    met, own_s, stood_s, time_s = set[str](), None, -DECISION_S, 0.0
    while time_s < (LIMIT_S if own_s is None else min(own_s + GRACE_S, LIMIT_S)) - 1e-6:
        seen, _, _, _, info = env.step(act(seen))
        time_s += DECISION_S
        if info["crashed"]:
            # What happens after its own success is no failure.
            return met | ({"crash"} if own_s is None else set()), own_s
        if info["is_success"] and own_s is None:
            met.add("own")
            own_s = time_s
        where, slot = goals_in(env)
        if is_reached(goal, where, slot, 1.0):
            met.add("goal")
        # All corners are inside: in a slot of 8 by 4 m that follows from the tolerances.
        stood_s = stood_s + DECISION_S if is_reached(parked, where, slot, 1.0) else -DECISION_S
        if stood_s >= parked.hold_s - 1e-6:
            return met | {"parked"}, own_s
    return met, own_s
