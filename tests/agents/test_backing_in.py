"""What states of a lorry cost: as much as its controllers drive where it can back straight in."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from race_agents.planning.backing_in import backing_in
from race_agents.planning.greedy import SETTLED, is_settled
from race_agents.training.greedy_teacher import GreedyTeacher
from race_agents.training.imitation import School
from race_agents.training.settings_toml import read_settings
from race_server.core import codes
from race_server.core.free_space.ground import NO_BOXES, Ground
from race_server.core.free_space.rig import Rig, Towed, rig_of
from race_server.core.free_space.state_costs import find_state_costs
from race_server.core.free_space.states import (
    AHEAD,
    BACK,
    UNKNOWN,
    StateCosts,
    cost_to_go,
    state_after,
)
from race_server.core.kernels.geometry import Pose
from race_server.core.kernels.trailers import axle_pose
from race_server.core.vehicle_presets import vehicle_named
from race_server.envs.batch import Batch
from race_server.envs.buffers import STAY
from race_server.envs.parking.heuristics.atlas import goal_in
from race_server.envs.presets import parking_task

LORRY = vehicle_named("lorry-16m5")
DOCK = Pose(0.0, 0.0, 0.0)
# Walls 3.5 m apart, from the end of a dock to 8 m before the axle of a trailer that stands in it.
WALLS = np.array([[-5.0, -1.75, 8.0, -1.75], [-5.0, 1.75, 8.0, 1.75], [-5.0, -1.75, -5.0, 1.75]])


@cache
def lane() -> tuple[Rig, StateCosts]:
    """Return a lorry, and what its states cost before the dock, in cells of 1 m."""
    rig = rig_of(LORRY, 0.1, 0.98)
    corner, other = Pose(-5.0, -4.0, 0.0), Pose(34.0, 4.0, 0.0)
    obstacles = Ground().obstacles(corner, other, WALLS, NO_BOXES, reach=1.0, near=6.0)
    ends = backing_in(obstacles, rig, DOCK)
    rate = 2.0 * rig.bend
    return rig, find_state_costs(obstacles, rig, DOCK, rate=rate, cusp=6.0, cell=1.0, ends=ends)


def cost(x: float, y: float, gear: int = BACK) -> float:
    return cost_to_go(lane()[1], DOCK, Towed(x, y, 0.0, 0.0, 0.0), gear)


def test_in_line_with_its_dock_a_lorry_has_only_to_back_up() -> None:
    assert cost(10.0, 0.0) == pytest.approx(10.0, abs=0.1)


def test_to_turn_round_first_costs_a_change_of_direction() -> None:
    # A step of two cells ahead, 6 m for turning round, and 12 m back.
    assert cost(10.0, 0.0, AHEAD) == pytest.approx(2.0 + 6.0 + 12.0, abs=0.1)


def test_four_metres_before_the_walls_it_is_too_late_to_shift_aside() -> None:
    # Its trailer stands 1 m aside: it has to drive ahead first, and turns round twice.
    assert cost(9.0, 1.0) > 9.0 + 2.0 * 6.0


def test_between_the_walls_and_askew_nothing_is_known() -> None:
    askew = Towed(4.0, 0.0, 0.6, 0.0, 0.0)
    assert cost_to_go(lane()[1], DOCK, askew, BACK) >= UNKNOWN


def test_a_hitch_bends_no_faster_than_the_tightest_bend_has_it() -> None:
    rig, found = lane()
    after = state_after(found, rig, Towed(0.0, 0.0, 0.0, 0.0, 0.0), 1.0, 0.1)
    assert after.curvature == pytest.approx(rig.bend)
    # From a straight hitch its angle grows by the curvature times 1 + hitch / bar.
    assert after.angle == pytest.approx(0.1 * rig.bend * (1.0 + rig.hitch / rig.bar), rel=0.01)


# A yard before one dock.
LOT = """
area = [0, 50, -0.5, 34.5]
vehicle = "lorry-16m5"
level = "dock"
limit_s = 180
[[rows]]
at = [25, 8.25]
heading = 90
length = 16.5
width = 3.5
[[zones]]
role = "start"
x = [12, 20]
y = [24, 28]
[taken]
share = 1.0
"""


def yard(folder: Path) -> Batch:
    """Return two lorries before their docks."""
    file = folder / "yard.toml"
    file.write_text(LOT)
    task = parking_task(str(file), observation="dock", action="dock")
    return Batch(task, worlds=2, seed=7, after=STAY)


@pytest.mark.slow
def test_a_lorry_that_does_what_the_teacher_says_docks(tmp_path: Path) -> None:
    batch = yard(tmp_path)
    teacher, begun = GreedyTeacher(batch, cell=1.0), np.ones((2, 1), np.bool_)
    before = teacher.labels(batch.observations, begun)
    batch.world.parking.blocks["kind"] = codes.NOTHING
    # Which neighbours are there does not change what it says.
    assert np.array_equal(teacher.labels(batch.observations, begun), before)
    for _ in range(1500):
        batch.step(teacher.labels(batch.observations, begun))
        if batch.terminated.all():
            break
    assert [batch.episode_of(w, 0)["ending"] for w in range(2)] == ["parked"] * 2


@pytest.mark.slow
def test_a_lorry_is_settled_where_its_trailer_stands_in_its_place(tmp_path: Path) -> None:
    world = yard(tmp_path).world
    body, vehicle, parker = world.bodies[0, 0], world.vehicles[0, 0], world.parking.parkers[0, 0]
    goal = goal_in(world.parking.lots.slots[0], LORRY)  # it points to the north
    body.heading = body.trailers[0].heading = goal.heading
    body.x = goal.x
    body.y += goal.y - axle_pose(body, vehicle, 1).y
    settled = []
    for along in (0.0, 0.1, 0.11):  # of 0.15 m it asks for 0.7
        body.y += along
        settled.append(is_settled(parker, vehicle, body, SETTLED))
        body.y -= along
    assert settled == [True, True, False]


@pytest.mark.slow
def test_where_it_knows_no_way_there_is_no_label(tmp_path: Path) -> None:
    batch = yard(tmp_path)
    batch.world.bodies[0, 0].x += 200.0
    labels = GreedyTeacher(batch, cell=1.0).labels(batch.observations, np.ones((2, 1), np.bool_))
    assert np.isnan(labels[0]).all()
    assert np.isfinite(labels[1]).all()


@pytest.mark.slow
def test_a_school_in_a_lot_has_the_teacher_that_knows_costs(tmp_path: Path) -> None:
    file = tmp_path / "yard.toml"
    file.write_text(LOT)
    settings = read_settings(
        "park-lorry", ["worlds=2", f'parking.lots=["{file}"]', "warm_start.cell=1.0"]
    )
    school = School(settings, lambda _: None)
    seen, labels = school.look(school.batch.layout.size)
    assert seen.shape == (2, school.batch.layout.size)
    assert labels.shape == (2, 2)
