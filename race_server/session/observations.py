"""What the seats of a session see."""

import numpy as np

from race_server.core.observation import PRESETS, Layout, layout_of, offsets_of
from race_server.core.stages.observe import observe_karts
from race_server.core.state import Float32s, World
from race_server.scenario.race import ABSENT
from race_server.scenario.sensors import sensors_for
from race_server.session.seats import Seat, Seats

NOBODY = -1  # in place of a preset


class Observations:
    """The observation vectors of all seats, worked out in one call."""

    def __init__(self, seats: int, rays: int) -> None:
        """Lay out what can be seen. rays: of the lidar."""
        names = list(PRESETS)
        self._layouts: list[Layout] = [layout_of(name, rays) for name in names]
        self._offsets = np.stack([offsets_of(layout) for layout in self._layouts])
        self._presets = np.full(seats, NOBODY, np.int64)  # their places in PRESETS
        size = max(layout.size for layout in self._layouts)
        self._values: Float32s = np.zeros((1, seats, size), np.float32)

    def begin(self, seats: Seats) -> None:
        """Show everybody in a race what their presets name."""
        names = list(PRESETS)
        for seat in seats:
            self._presets[seat.number] = names.index(seat.preset) if seat.is_taken else NOBODY

    def look(self, world: World) -> None:
        """Work out what every seat sees now."""
        observe_karts(world, self._offsets, self._presets, self._values)

    def of(self, seat: int) -> Float32s:
        """Return the observation vector of a seat as of the last `look`."""
        layout = self._layouts[int(self._presets[seat])]
        return self._values[0, seat, : layout.size]


def fitted_for(seat: Seat) -> int:
    """Return the sensors that the kart of a seat needs."""
    return sensors_for(PRESETS[seat.preset]) if seat.is_taken else ABSENT
