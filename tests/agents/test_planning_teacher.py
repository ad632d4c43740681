"""A teacher that plans: its labels lead a lorry into its bay, and it says where it knows no way."""

import numpy as np
import pytest

from race_agents.training.imitation import School
from race_agents.training.planning_teacher import MARGINS, PlanningTeacher
from race_agents.training.settings import Settings
from race_agents.training.settings_toml import read_settings
from race_server.core import codes
from race_server.envs.batch import Batch
from race_server.envs.buffers import STAY
from race_server.envs.presets import parking_task
from race_server.errors import ScenarioError


def yard(worlds: int = 2, action: str = "dock", after: int = STAY) -> Batch:
    """Return lorries before their docks."""
    task = parking_task("dock-35", observation="dock", action=action)
    return Batch(task, worlds=worlds, seed=7, after=after)


@pytest.mark.slow
def test_who_does_what_the_teacher_says_stands_in_the_bay() -> None:
    batch = yard()
    teacher, begun = PlanningTeacher(batch), np.ones((2, 1), np.bool_)
    open_ways = np.ones(2, np.bool_)
    for _ in range(1500):
        labels = teacher.labels(batch.observations, begun)
        assert np.isfinite(labels[open_ways]).all()
        batch.step(np.nan_to_num(labels))
        begun = np.zeros((2, 1), np.bool_)
        open_ways &= batch.terminated[:, 0] == 0
        if not open_ways.any():
            break
    assert [batch.episode_of(w, 0)["ending"] for w in range(2)] == ["parked"] * 2
    # One way each, looked for with at most two margins.
    assert 2 <= teacher.plans <= 2 * len(MARGINS)


def test_which_neighbours_are_there_does_not_change_the_labels() -> None:
    batch, begun = yard(), np.ones((2, 1), np.bool_)
    before = PlanningTeacher(batch).labels(batch.observations, begun)
    batch.world.parking.blocks["kind"] = codes.NOTHING
    after = PlanningTeacher(batch).labels(batch.observations, begun)
    assert np.array_equal(before, after)


def test_where_it_knows_no_way_there_is_no_label() -> None:
    batch, begun = yard(), np.ones((2, 1), np.bool_)
    body = batch.world.bodies[0, 0]
    body.trailers[0].heading = body.heading - 1.65  # beyond the limit of 90 degrees
    labels = PlanningTeacher(batch).labels(batch.observations, begun)
    assert np.isnan(labels[0]).all()
    assert np.isfinite(labels[1]).all()


def test_it_refuses_what_it_cannot_answer_with() -> None:
    with pytest.raises(ScenarioError, match=r"action = .park.: .*choose .dock."):
        PlanningTeacher(yard(action="park"))


def lorry(*changes: str) -> Settings:
    return read_settings("park-lorry", ["worlds=2", *changes])


def test_a_school_in_a_lot_has_the_teacher_that_plans() -> None:
    school = School(lorry(), lambda _: None)
    seen, labels = school.look(school.batch.layout.size)
    assert seen.shape == (2, school.batch.layout.size)
    assert labels.shape == (2, 2)
