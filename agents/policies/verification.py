"""Verify a policy file on observations from a set of courses, or from rounds in lots.

Nothing here needs PyTorch; `race_agents.training.parity` makes the comparison with the learner.
"""

import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import islice
from typing import Any

import numpy as np
from numpy.typing import NDArray

from race_agents.policies.metadata import PolicyMetadata
from race_agents.policies.session import Policy
from race_server.core.clock import ticks_of
from race_server.core.observation import wants_line
from race_server.core.vehicle_presets import vehicle_named
from race_server.envs.batch import Batch
from race_server.envs.parking import Parking
from race_server.envs.presets import LEARNING_RULES, task_on
from race_server.envs.task import Task
from race_server.scenario.parking import parking_scenario
from race_server.scenario.race import Scenario
from race_server.scenario.sensors import Lidar
from race_server.scenario.track.sets import course_named, set_named

# Sets of tracks, for model cars and for longer vehicles.
UNSEEN, UNSEEN_KART = "unseen", "unseen-kart"
# Beside the lots that a policy learned in, whose rounds have other seeds.
UNSEEN_LOTS = ("generated:yard:900", "generated:aisle:900")
WORLDS = 16
EPISODE_S = 60.0
SEED = 300_000  # far from those of training and evaluation
# Opponents of a policy that observes other karts.
OTHERS = ("follow_gap", "pure_pursuit", "avoider")
# Largest difference between a policy file and its learner: rounding in single precision. Of layers
# of 512, 256 and 128 the file was 9e-6 from the exact answer, and the learner 12e-6.
MOST_DIFFERENCE = 2e-5
WARM_UP = 200  # decisions that are not timed

Rows = NDArray[np.float32]


@dataclass(frozen=True)
class Times:
    """Times of decisions, one observation at a time, on one thread [µs]."""

    median: float
    p99: float
    mean: float


def observations_of(policy: Policy, count: int) -> Rows:
    """Return observations of a policy that drives, shape (count, size).

    Raises:
        RaceError: it cannot drive there.
    """
    batch = Batch(_task(policy.metadata), worlds=WORLDS, seed=SEED)
    rows = np.concatenate(list(islice(_seen(batch, policy), -(-count // WORLDS))))
    batch.close()
    return np.ascontiguousarray(rows[:count])


def _seen(batch: Batch, policy: Policy) -> Iterator[Rows]:
    while True:
        seen = batch.observations[:, 0].copy()
        yield seen
        batch.step(policy.decide(seen))


def _task(metadata: PolicyMetadata) -> Task:
    """Return a task of a set of tracks, from random places, without end; or of lots."""
    if metadata.lots:
        return _lots_task(metadata)
    others = OTHERS if any(part.startswith("karts") for part in metadata.parts) else ()
    # Without lidar in the observation the number of rays does not matter.
    lidar = Lidar(rays=metadata.lidar_rays) if metadata.lidar_rays else Lidar()
    scenarios = [
        Scenario(
            course_named(name),
            karts=1 + len(others),
            vehicles=(vehicle_named(vehicle),),
            rules=LEARNING_RULES,
            lidar=lidar,
        )
        for name in _courses(metadata)
        for vehicle in metadata.vehicles
    ]
    return task_on(
        tuple(scenarios),
        opponents=others,
        learners=1,
        observation=metadata.parts,
        action=metadata.action,
        base=metadata.base,
        decision_ticks=ticks_of(metadata.decision_s),
        most_steps=round(EPISODE_S / metadata.decision_s),
        random_start=True,
    )


def _lots_task(metadata: PolicyMetadata) -> Task:
    """Return a task of the lots that a policy learned in, and of unseen ones."""
    lidar = Lidar(rays=metadata.lidar_rays) if metadata.lidar_rays else Lidar()
    scenarios = [
        replace(parking_scenario(name, vehicle=vehicle, level=metadata.level), lidar=lidar)
        for name in (*metadata.lots, *UNSEEN_LOTS)
        for vehicle in metadata.vehicles
    ]
    return Task(tuple(scenarios), Parking()).with_options(
        observation=metadata.parts,
        action=metadata.action,
        reward="park",
        decision_ticks=ticks_of(metadata.decision_s),
    )


def set_for(vehicle: str) -> str:
    """Return the name of the set of tracks for policies of a vehicle.

    It is that of the last evaluation, unless a policy's settings say otherwise: it may have learned
    on some.
    """
    return UNSEEN if vehicle_named(vehicle).is_model_car else UNSEEN_KART


def _courses(metadata: PolicyMetadata) -> list[str]:
    """Return the courses of the set; with a reference line only those whose line is bundled."""
    names = set_named(set_for(metadata.vehicle))
    if metadata.base or wants_line(metadata.parts):
        return [name for name in names if not name.startswith("generated:")]
    return names


def times_of(policy: Policy, seen: Rows) -> Times:
    """Return the times of decisions of a policy on observations (n, size)."""
    rows = [np.ascontiguousarray(row[None]) for row in seen]
    for row in rows[:WARM_UP]:
        policy.decide(row)
    times: list[int] = []
    for row in rows:
        begun = time.perf_counter_ns()
        policy.decide(row)
        times.append(time.perf_counter_ns() - begun)
    spent: NDArray[Any] = np.array(times) / 1e3
    median, p99 = np.percentile(spent, [50, 99]).tolist()
    return Times(median=median, p99=p99, mean=float(spent.mean()))
