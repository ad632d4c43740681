"""Where a kart is among known walls, scan by scan; and where it may be once it is lost."""

from dataclasses import replace

import numpy as np

from race_agents.planning.lap_survey import (
    FITTING,
    LEAST_SLIP,
    LEAST_TWIST,
    SLIP,
    TWIST,
)
from race_agents.planning.wall_map import Fit, Pose, Scan, WallMap, compose
from race_server.core.state import Floats

# Scans in a row that fit nowhere, until a kart is lost; places tried with each scan from then on.
PATIENCE, TRIES = 4, 3
# The share of a scan that must fit where a lost kart is found.
FOUND = 0.75
COARSE = 4.0


class Wayfinder:
    """The pose of a kart in a map of walls."""

    def __init__(self, walls: WallMap, pose: Pose) -> None:
        """Begin at a pose that is known roughly."""
        self.walls, self.pose = walls, pose
        self.failures = 0
        self._coarse = WallMap(walls.points, walls.normals, COARSE * walls.cell)
        self._tried = 0
        self._best = Fit(pose, 0.0, 0.0)  # of the places tried in this round

    @property
    def is_lost(self) -> bool:
        """Whether the last scans fit nowhere."""
        return self.failures >= PATIENCE

    def move(self, scan: Scan, moved: Pose, way: float) -> None:
        """Take in a scan. moved: by odometry since the one before; way: driven [m]."""
        guess = compose(self.pose, moved)
        self._best = replace(self._best, pose=compose(self._best.pose, moved))
        trust = (LEAST_SLIP + SLIP * way, LEAST_TWIST + TWIST * abs(moved[2]))
        fit = self.walls.match(scan, guess, trust)
        if fit.share < FITTING:
            self.failures += 1
            self.pose = guess
        else:
            self.failures, self.pose = 0, fit.pose

    def settle(self, scan: Scan) -> None:
        """Fit a scan once more, from farther away: the map has changed a little."""
        self._take(self._from_afar(scan, self.pose))

    def search(self, scan: Scan, places: Floats) -> None:
        """Try some places (N, 3) x, y [m], heading [rad] where a lost kart may be.

        The best of all places is taken once all were tried, and the scan still fits there.
        """
        for _ in range(TRIES):
            x, y, heading = places[self._tried]
            fit = self._from_afar(scan, (x, y, heading))
            if fit.share > self._best.share:
                self._best = fit
            self._tried += 1
            if self._tried >= len(places):
                self._tried = 0
                self._take(self._from_afar(scan, self._best.pose))
                self._best = Fit(self.pose, 0.0, 0.0)
                return

    def _from_afar(self, scan: Scan, guess: Pose) -> Fit:
        far = COARSE * self.walls.cell
        fit = self._coarse.match(scan, guess, (far, 0.2))
        return self.walls.match(scan, fit.pose, (far, 0.1))

    def _take(self, fit: Fit) -> None:
        if fit.share >= FOUND:
            self.failures, self.pose = 0, fit.pose


def places_along(line: Floats, spacing: float, step: float) -> Floats:
    """Return places (M, 3) about every `step` [m] of a line (N, 3+)."""
    return np.asarray(line[:: max(round(step / spacing), 1), :3])
