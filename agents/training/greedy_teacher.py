"""A teacher that knows the costs to go: it labels what a vehicle drives to that learns to park.

The costs are made once for slots that are alike, and kept. So that the same answer belongs
to the same place, all slots but its own are taken for occupied where the lot may occupy them,
whichever are: what the round has drawn there does not matter.
"""

import os
from concurrent.futures import ThreadPoolExecutor
from functools import partial

import numpy as np
from numpy.typing import NDArray

from race_agents.planning.backing_in import MOST_STEPS
from race_agents.planning.greedy import Guide, lead_all
from race_agents.planning.guides import alike_slots, guide_to
from race_agents.training.lines import Say
from race_server.core.free_space.state_costs import CELL
from race_server.envs.actions import CRAWLED, action_kind
from race_server.envs.batch import Batch
from race_server.envs.parking.heuristics.atlas import check_lot, goal_in
from race_server.errors import ScenarioError

Labels = NDArray[np.float32]

# Kinds of actions that it answers with: a speed and steering each.
ANSWERS = ("dock", "crawl")


class GreedyTeacher:
    """Knows what the vehicle of every world of a batch is to do."""

    def __init__(self, batch: Batch, say: Say = lambda _: None, *, cell: float = CELL) -> None:
        """Find the costs to go to the slots of all lots.

        cell: side of a cell [m] for the usual bar.

        Raises:
            ScenarioError: the vehicles do not learn alone, have other actions than a speed and
                steering, or a lot has no slots, or draws blocks.
        """
        if batch.task.action not in ANSWERS:
            raise ScenarioError(
                f"action = {batch.task.action!r}: a teacher in a lot answers with a speed and "
                f"steering; choose {' or '.join(map(repr, ANSWERS))}"
            )
        if batch.learners != 1:
            raise ScenarioError(
                f"race.learners = {batch.learners}: a teacher in a lot has one vehicle in each; "
                "choose 1"
            )
        self._batch, self._vehicle = batch, batch.scenarios[0].vehicle_of(0)
        self._kind = action_kind(batch.task.action)
        world = batch.world
        lots = world.parking.lots
        self._goals = np.array([goal_in(slot, self._vehicle) for slot in lots.slots])
        self._rows = np.zeros(len(lots.slots), np.int64)  # of each slot, its place in `_guides`
        self._guides: list[Guide] = []
        for number, lot in enumerate(lots.lots):
            check_lot(lot, batch.scenarios[number].course.name, "a teacher in a lot")
            rows = alike_slots(lots, world.walls, number, self._vehicle)
            for place, row in enumerate(rows, start=len(self._guides)):
                self._rows[int(lot["slot_start"]) + np.array(row)] = place
            say(f"costs to go to slots: 0 of {len(rows)}")
            guided = partial(guide_to, lots, world.walls, number, vehicle=self._vehicle, cell=cell)
            with ThreadPoolExecutor(os.cpu_count()) as pool:
                found = pool.map(guided, [row[len(row) // 2] for row in rows])
                for done, guide in enumerate(found, start=1):
                    say(f"costs to go to slots: {done} of {len(rows)}")
                    self._guides.append(guide)
        self._controls = np.zeros((batch.worlds, 2))
        self._work = np.zeros((MOST_STEPS, 3))

    def labels(self, seen: NDArray[np.float32], begun: NDArray[np.bool_]) -> Labels:
        """Return the actions that lead to where the costs to go are less, shape (W, 2).

        They are not numbers where it knows none. seen, begun: are not needed.
        """
        del seen, begun
        world, vehicle, controls = self._batch.world, self._vehicle, self._controls
        parkers = world.parking.parkers
        slots = world.parking.lots.lots["slot_start"][world.rules["course"]] + parkers["slot"][:, 0]
        rows = self._rows[slots]
        for row in np.unique(rows):
            lead_all(
                np.flatnonzero(rows == row),
                world.bodies,
                world.vehicles,
                parkers,
                self._goals[slots],
                self._guides[row],
                self._work,
                controls,
            )
        speeds = controls[:, 0]
        most = np.where(speeds > 0.0, vehicle.top_speed, vehicle.reverse_speed)
        shares = speeds / most
        if self._kind == CRAWLED:
            shares = np.copysign(np.sqrt(np.abs(shares)), shares)
        return np.stack([shares, controls[:, 1]], axis=1).astype(np.float32)

    def record_driven(self, actions: NDArray[np.float32]) -> None:
        """Do nothing: it looks where the vehicles are."""
