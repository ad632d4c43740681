"""The observations of the seats of a session."""

from collections.abc import Iterable

import numpy as np

from race_server.core import codes
from race_server.core.observation import PRESETS, Layout, layout_of, offsets_of
from race_server.core.stages.observe import observe_karts
from race_server.core.state import Float32s, World
from race_server.scenario.race import ABSENT
from race_server.scenario.sensors import sensors_for
from race_server.session.seats import Seat

NO_PRESET = -1  # of a seat without a driver


class Observations:
    """The observation vectors of all seats, computed in one call."""

    def __init__(self, seats: int, rays: int) -> None:
        """Lay out the observations of all presets. rays: of the lidar."""
        names = list(PRESETS)
        self._layouts: list[Layout] = [layout_of(name, rays) for name in names]
        self._offsets = np.stack([offsets_of(layout) for layout in self._layouts])
        self._presets = np.full(seats, NO_PRESET, np.int64)  # their places in PRESETS
        size = max(layout.size for layout in self._layouts)
        self._values: Float32s = np.zeros((1, seats, size), np.float32)

    def begin(self, seats: Iterable[Seat]) -> None:
        """Begin a race: every seat that takes part observes what its preset names."""
        names = list(PRESETS)
        self._presets[:] = NO_PRESET
        for seat in seats:
            self._presets[seat.number] = names.index(seat.preset)

    def show(self, seat: int, preset: str) -> None:
        """Let a seat observe what a preset names; "" for nothing."""
        self._presets[seat] = list(PRESETS).index(preset) if preset else NO_PRESET

    def compute(self, world: World) -> None:
        """Compute the observations of all seats now."""
        observe_karts(world, self._offsets, self._presets, self._values)

    def of(self, seat: int) -> Float32s:
        """Return the observation vector of a seat as of the last `compute`."""
        layout = self._layouts[int(self._presets[seat])]
        return self._values[0, seat, : layout.size]


def fitted_for(seat: Seat, *, parks: bool = False) -> int:
    """Return the sensors that the kart of a seat needs.

    parks: the parking driver of the server may take the wheel, and see by any sensor.
    """
    if not seat.is_taken:
        return ABSENT
    return sensors_for(PRESETS[seat.preset]) | (codes.LIDAR | codes.RADAR if parks else 0)
