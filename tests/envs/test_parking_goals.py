"""What a goal apart from observations is worth: corners in the slot, and a crash far from it."""

import math
from typing import Any

import gymnasium
import numpy as np
import pytest

import race_server.envs  # noqa: F401  # registers the ids
from race_server.envs.parking.goal import CRASH, METRES, Room, is_reached
from race_server.scenario.level import LEVELS

SLOT = np.array([0.0, 0.0, 1.0, 0.0, 0.0])


def reached(x: float, y: float, degrees: float, room: Room | None) -> bool:
    """Return whether a vehicle that stands there is parked by all but the time to hold."""
    turn = math.radians(degrees)
    pose = np.array([x / METRES, y / METRES, math.cos(turn), math.sin(turn), 0.0])
    return bool(is_reached(LEVELS["parked"], pose, SLOT, 1.0, room))


@pytest.mark.parametrize(
    ("x", "y", "degrees", "fits"),
    [
        (0.0, 0.0, 0.0, True),
        (0.19, 0.0, 0.0, True),
        (0.21, 0.0, 0.0, False),
        (-0.21, 0.0, 0.0, False),
        (0.0, 0.09, 0.0, True),
        (0.0, 0.11, 0.0, False),
        (0.0, 0.0, 2.0, True),  # the corners are 0.07 m farther out than straight
        (0.0, 0.05, 2.0, False),
    ],
)
def test_all_corners_have_to_be_in_the_slot(x: float, y: float, degrees: float, fits: bool) -> None:
    # 0.2 m to spare before and behind, 0.1 m on each side.
    room = Room(slot_length=4.4, slot_width=2.2, length=4.0, width=2.0)
    assert reached(x, y, degrees, room) is fits
    assert reached(x, y, degrees, None)


def test_a_car_whose_corner_is_out_of_its_bay_has_not_reached_its_goal() -> None:
    env: Any = gymnasium.make("Kart/ParkGoal-v0", lot="aisle-90", level="parked").unwrapped
    room = env.view.room
    assert (room.length, room.width) == (4.689, 1.942)
    spare = 0.5 * (room.slot_length - room.length) / METRES
    for off, reward in ((spare - 0.001, 0.0), (spare + 0.001, -1.0)):
        pose = SLOT + np.array([off, 0.0, 0.0, 0.0, 0.0])
        assert env.compute_reward(pose, SLOT, {}) == reward


def test_slots_of_several_sizes_tell_nothing_of_corners() -> None:
    env: Any = gymnasium.make("Kart/ParkGoal-v0", lot="kerb", level="parked").unwrapped
    assert env.view.room is None


def test_no_crash_pays_with_the_sparse_reward_and_with_the_dense_one_only_near_the_slot() -> None:
    def costs(reward: str, away: float) -> tuple[float, float]:
        """Return what it costs to stand for ever, and to crash now. away: [m] ahead."""
        env: Any = gymnasium.make("Kart/ParkGoal-v0", reward=reward).unwrapped
        pose = SLOT + np.array([away / METRES, 0.0, 0.0, 0.0, 0.0])
        one = -float(env.compute_reward(pose, SLOT, {}))
        return one / (1.0 - 0.95), one - CRASH

    # 20 at each distance against 21; the root of 2.5, and of 0.9, times 20 against 20 more.
    assert costs("sparse", 25.0) == pytest.approx((20.0, 21.0))
    stand, crash = costs("dense", 25.0)
    assert (stand, crash) == pytest.approx((31.6, 21.6), abs=0.05)
    stand, crash = costs("dense", 9.0)
    assert stand < crash
