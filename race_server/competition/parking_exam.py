"""The exam of parking: a driver, and one task after another, each decided by its seed.

Many tasks are driven side by side, each in a world of one batch. Several vehicles of one task have
a driver each.
"""

import math
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from race_server.competition.time_trial.run import numbers_of
from race_server.core import codes
from race_server.core.clock import TICK_S
from race_server.core.driver import Briefing, Driver, driver_named, tell_to_park
from race_server.core.observation import Observation
from race_server.core.parking_order import ParkingOrder, order_of
from race_server.core.poses import poses_of
from race_server.core.seeds import HELD_OUT, MOST_SEED
from race_server.core.state import Float32s, Floats
from race_server.core.traffic import STANDING, Traffic
from race_server.envs.batch import Batch
from race_server.envs.parking import Parking
from race_server.envs.reality_gap import MOST_DELAY, RealityGap
from race_server.envs.task import Task
from race_server.errors import DriverError, ScenarioError
from race_server.scenario.lot.load import load_lot
from race_server.scenario.parking import parking_scenario
from race_server.scenario.race import Scenario

# Those of the report on automatic parking of a kart, 2022.
SCENARIOS = {"1": "zone-30", "2": "yard-70"}
DECISION_TICKS = 6
DECISION_S = DECISION_TICKS * TICK_S
# Tasks that are driven side by side.
SIDE_BY_SIDE = 64
# How an episode ends whose driver raised an exception, and how much is told of that [characters].
FAULT, MOST_WORDS = "driver", 200
BRAKE = np.array([0.0, 0.0, 1.0, 0.0], np.float32)


@dataclass(frozen=True)
class ExamSpec:
    """What is asked of every driver. Empty or zero: as the lot says."""

    scenario: str  # a name of SCENARIOS, or of a lot
    seeds: Sequence[int] = range(HELD_OUT + 1, HELD_OUT + 1001)
    vehicles: int = 1
    vehicle: str = ""
    level: str = ""
    limit_s: float = 0.0
    delay_s: float = 0.0  # from an answer to its effect
    noise: float = 0.0  # [m] of the ranges of radar and lidar, one standard deviation
    gap: RealityGap = field(default_factory=RealityGap)  # but for the delay

    @property
    def lot(self) -> str:
        """The name of the lot."""
        return SCENARIOS.get(self.scenario, self.scenario)

    @property
    def level_name(self) -> str:
        """The name of the level, the lot's unless another is asked for."""
        lot = load_lot(self.lot).lot
        return self.level or (lot.level if lot is not None else "")

    def scenario_of(self) -> Scenario:
        """Return the scenario of all tasks.

        Raises:
            LotError, VehicleError, ScenarioError: a name is unknown.
        """
        scenario = parking_scenario(
            self.lot,
            vehicles=self.vehicles,
            vehicle=self.vehicle,
            level=self.level,
            limit_s=self.limit_s,
        )
        radar, lidar = scenario.radar, scenario.lidar
        return replace(
            scenario,
            radar=replace(radar, noise=self.noise),
            lidar=replace(lidar, noise=self.noise),
        )

    def task_of(self, scenario: Scenario, preset: str) -> Task:
        """Return the task of a driver that observes a preset.

        Raises:
            ScenarioError: the delay is no whole number of decisions.
        """
        is_finite = math.isfinite(self.delay_s)
        delay = round(self.delay_s / DECISION_S) if is_finite else -1
        if abs(delay * DECISION_S - self.delay_s) > 1e-6 or not 0 <= delay <= MOST_DELAY:
            raise ScenarioError(
                f"delay {self.delay_s:g} s: drivers decide every {DECISION_S:g} s, choose a "
                f"multiple of that up to {MOST_DELAY * DECISION_S:g} s"
            )
        return Task(
            (scenario,),
            Parking(),
            observation=preset,
            action="control",
            reward="park",
            gap=replace(self.gap, action_delay=(float(delay), float(delay))),
            decision_ticks=DECISION_TICKS,
        )


@dataclass(frozen=True, eq=False)
class Try:
    """How a driver did with one vehicle of a task."""

    seed: int
    figures: dict[str, Any]  # see `race_server/envs/parking/discipline.py:Parking.report`
    order: ParkingOrder
    start: Floats  # (4,), see `poses_of`
    end: Floats  # (4,) the same at the last decision
    fault: str = ""  # what the driver raised
    vehicle: int = 0
    # [ms] wall time of each answer but the first of the exam
    decisions_ms: Float32s = field(default_factory=lambda: np.zeros(0, np.float32))
    round_seed: int = 0  # of the world's round, which the seed of the task decides
    pause_s: float = 0.0  # longest time in which no vehicle moved of those that drove like this one


def drive_exam(
    spec: ExamSpec, name: str, make: Callable[[str], Driver] = driver_named
) -> Iterator[Try]:
    """Yield how a driver did with each vehicle of each task, in the order in which they end.

    Raises:
        LotError, VehicleError, ScenarioError: the exam makes no task.
        DriverError: the driver is unknown, cannot park, or not with this vehicle.
    """
    with _hall_of(spec, name, make, list(spec.seeds)) as hall:
        yield from hall.drive()


def check_exam(spec: ExamSpec, name: str, make: Callable[[str], Driver] = driver_named) -> None:
    """Begin the first task of an exam, and leave it: what `drive_exam` raises comes at once.

    Raises:
        LotError, VehicleError, ScenarioError, DriverError: see `drive_exam`.
    """
    with _hall_of(spec, name, make, list(spec.seeds[:1])):
        pass


@contextmanager
def _hall_of(
    spec: ExamSpec, name: str, make: Callable[[str], Driver], seeds: list[int]
) -> "Iterator[_Hall]":
    """Hold what an exam takes place in. make: makes a driver of its name."""
    if not seeds or min(seeds) < 0 or max(seeds) > MOST_SEED:
        raise ScenarioError(
            f"seeds {seeds[:3]}: give one or more, none below zero or from 2**63 on"
        )
    scenario, count = spec.scenario_of(), min(SIDE_BY_SIDE, len(seeds))
    drivers = [[make(name) for _ in range(spec.vehicles)] for _ in range(count)]
    batch = Batch(spec.task_of(scenario, drivers[0][0].preset), worlds=count)
    try:
        yield _Hall(batch, scenario, name, drivers, deque(seeds))
    finally:
        batch.close()


class _Hall:
    """All worlds of an exam, and their drivers."""

    def __init__(
        self,
        batch: Batch,
        scenario: Scenario,
        name: str,
        drivers: Sequence[Sequence[Driver]],
        waiting: deque[int],
    ) -> None:
        """Begin a task in each world. drivers: of each vehicle in each world; waiting: the seeds.

        Raises:
            DriverError: the driver cannot park, or not with this vehicle.
        """
        self.batch = batch
        self.name = name
        self.drivers = drivers
        self.waiting = waiting
        self.begun: dict[tuple[int, int], Try] = {}  # by world and vehicle
        self._times: dict[tuple[int, int], list[float]] = {}  # [ms] of answers
        self._is_ready = False  # after the first answer, which may compile
        self._briefings = [
            Briefing(
                seat=k,
                vehicle=scenario.vehicle_of(k),
                laps=0,
                preset=drivers[0][0].preset,
                decision_s=DECISION_S,
                lidar_field=scenario.lidar.field,
                lidar_reach=scenario.lidar.reach,
                waits=True,
            )
            for k in range(batch.karts)
        ]
        self._traffic: dict[int, Traffic] = {}  # by world, where there are several vehicles
        self._stood_s = np.zeros(batch.worlds)  # how long no vehicle of a world has moved
        self._coming: list[int | None] = [None] * batch.worlds  # seeds of the next rounds
        for w in range(batch.worlds):
            self._let_follow(w)
        batch.reset()
        for w in range(batch.worlds):
            self._begin(w)

    def drive(self) -> Iterator[Try]:
        """Yield how each task went."""
        batch = self.batch
        while self.begun:
            places = self._places()
            for w, traffic in self._traffic.items():
                traffic.watch(batch.world, w)
            for w, k in self.begun:
                batch.buffers.actions[w, k] = self._answer(w, k)
            self._count_pauses()
            batch.step()
            over = batch.terminated | batch.truncated
            for w, k in [pair for pair in self.begun if over[pair]]:
                yield self._outcome(w, k, places[w, k])
                batch.buffers.actions[w, k] = BRAKE
                if not any((w, other) in self.begun for other in range(batch.karts)):
                    self._begin(w)

    def _count_pauses(self) -> None:
        """Note for how long no vehicle has moved of those that are on their way in a world."""
        bodies = self.batch.world.bodies
        moves = (bodies["status"] == codes.RACING) & (np.abs(bodies["speed"]) >= STANDING)
        self._stood_s = np.where(moves.any(axis=1), 0.0, self._stood_s + DECISION_S)
        for (w, k), task in self.begun.items():
            if self._stood_s[w] > task.pause_s:
                self.begun[w, k] = replace(task, pause_s=float(self._stood_s[w]))

    def _let_follow(self, w: int) -> None:
        """Set the seed of a world's next round."""
        self._coming[w] = self.waiting.popleft() if self.waiting else None
        self.batch.seed_next(w, self._coming[w] or 0)

    def _begin(self, w: int) -> None:
        """Take up the round that a world has just begun; behind the last seed none counts."""
        batch, seed = self.batch, self._coming[w]
        self._traffic.pop(w, None)
        self._stood_s[w] = 0.0
        batch.buffers.actions[w] = BRAKE
        if seed is None:
            return
        self._let_follow(w)
        if batch.karts > 1:
            self._traffic[w] = Traffic(batch.karts)
            self._traffic[w].watch(batch.world, w)
        places, round_seed = self._places()[w], int(batch.world.races[w].seed)
        for k, driver in enumerate(self.drivers[w]):
            order = order_of(batch.world, w, k)
            self.begun[w, k] = Try(
                seed, {}, order, places[k], places[k], vehicle=k, round_seed=round_seed
            )
            self._times[w, k] = []
            try:
                driver.reset(self._briefings[k])
                tell_to_park(driver, self.name, order, self._traffic.get(w))
            except DriverError:
                raise
            except Exception as error:
                self._fail(w, k, error)

    def _places(self) -> Floats:
        """Return where the vehicles are: (W, K, 4), see `poses_of`."""
        return poses_of(self.batch.world.bodies, self.batch.world.vehicles)

    def _answer(self, w: int, k: int) -> Float32s:
        """Return the control of a driver; one that raised an exception brakes."""
        task = self.begun[w, k]
        if task.fault:
            return BRAKE
        batch = self.batch
        # A copy, so that a driver cannot change the buffer of the world.
        seen = batch.observations[w, k].copy()
        observation = Observation(int(batch.world.races[w].tick), batch.layout, seen)
        begun = time.perf_counter()
        try:
            return numbers_of(self.drivers[w][k].act(observation))
        except Exception as error:  # a driver's fault ends its task, not the exam
            self._fail(w, k, error)
            return BRAKE
        finally:
            if self._is_ready:
                self._times[w, k].append(1e3 * (time.perf_counter() - begun))
            self._is_ready = True

    def _fail(self, w: int, k: int, error: Exception) -> None:
        """Note what a driver raised: from now on its vehicle brakes."""
        words = str(error).partition("\n")[0][:MOST_WORDS]
        self.begun[w, k] = replace(self.begun[w, k], fault=f"{type(error).__name__}: {words}")

    def _outcome(self, w: int, k: int, end: Floats) -> Try:
        """Return how the task of a vehicle went. end: the place before the last decision."""
        task, figures = self.begun.pop((w, k)), self.batch.episode_of(w, k)
        if task.fault:
            figures |= {"is_success": False, "aligned": False, "ending": FAULT}
        times = np.array(self._times.pop((w, k)), np.float32)
        return replace(task, figures=figures, end=end, decisions_ms=times)
