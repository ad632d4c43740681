"""Figures of rounds with several vehicles."""

from dataclasses import replace

import numpy as np
import pytest

from race_server.competition.parking_exam import ExamSpec, Try, drive_exam
from race_server.competition.parking_rounds import RoundTally
from race_server.core.driver import Briefing
from race_server.core.messages import Control
from race_server.core.observation import Observation
from race_server.core.parking_order import ParkingOrder, Slot
from race_server.core.traffic import Traffic
from race_server.scenario.level import level_named

ORDER = ParkingOrder(
    Slot(0.0, 0.0, 0.0, 3.0, 2.0), level_named("parked"), np.zeros((0, 4)), np.zeros((0, 5))
)


def parked(seed: int, vehicle: int, time_s: float) -> Try:
    """Return a try of a vehicle that was parked."""
    figures = {"is_success": True, "ending": "parked", "time_s": time_s}
    return Try(seed, figures, ORDER, np.zeros(3), np.zeros(3), vehicle=vehicle)


def test_a_round_counts_as_parked_when_all_of_its_vehicles_are() -> None:
    late = replace(parked(2, 1, 60.0), figures={"is_success": False, "ending": "late"})
    tally = RoundTally.of([parked(1, 0, 20.0), parked(1, 1, 40.0), parked(2, 0, 10.0), late])
    assert (tally.rounds, tally.all_parked_rate, tally.failed_seeds) == (2, 0.5, (2,))
    assert (tally.time_s_mean, tally.last_time_s_mean, tally.parked_mean) == (30.0, 40.0, 1.5)
    assert (tally.with_contact, tally.deadlocks) == (0, 0)


def test_a_contact_of_one_vehicle_is_one_of_the_round() -> None:
    crashed = replace(parked(1, 1, 5.0), figures={"is_success": False, "ending": "vehicle"})
    tally = RoundTally.of([parked(1, 0, 20.0), crashed, replace(crashed, vehicle=2)])
    assert (tally.with_contact, tally.all_parked_rate) == (1, 0.0)


def test_more_than_ten_seconds_without_motion_are_a_deadlock_of_the_round() -> None:
    rounds = [
        replace(parked(seed, 0, 30.0), pause_s=pause) for seed, pause in ((1, 10.0), (2, 11.0))
    ]
    tally = RoundTally.of(rounds)
    assert (tally.deadlocks, tally.deadlock_seeds) == (1, (2,))
    assert tally.deadlock_rate == pytest.approx(0.5)


class Stays:
    """Stands, and knows its traffic."""

    preset = "lot"

    def reset(self, briefing: Briefing) -> None:
        self.seat = briefing.seat

    def join(self, traffic: Traffic) -> None:
        self.traffic = traffic

    def park(self, order: ParkingOrder) -> None:
        self.slot = order.slot

    def act(self, observation: Observation) -> Control:
        # Its own place is that of the traffic.
        x, y = (observation.scalar(f"position_{axis}") for axis in "xy")
        assert self.traffic.boxes[self.seat, 0, :2] == pytest.approx((x, y), abs=1e-3)
        return Control(brake=1.0)


def test_each_vehicle_of_a_round_has_a_driver_and_they_share_their_traffic() -> None:
    drivers: list[Stays] = []

    def make(_: str) -> Stays:
        drivers.append(Stays())
        return drivers[-1]

    spec = ExamSpec("gate", [1, 2], vehicles=2, limit_s=12.0)
    tries = list(drive_exam(spec, "stays", make))
    assert sorted((one.seed, one.vehicle) for one in tries) == [(1, 0), (1, 1), (2, 0), (2, 1)]
    assert {one.fault for one in tries} == {""}
    first, second, *others = [driver.slot for driver in drivers]
    assert first != second
    assert len(others) == 2
    tally = RoundTally.of(tries)
    assert (tally.all_parked_rate, tally.deadlocks) == (0.0, 2)
