"""A function as the driver of karts that do not learn: one call for all that share it."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from race_server.core.kernel_driver import Cockpits
from race_server.core.observation import Layout
from race_server.core.state import Float32s
from race_server.errors import DriverError

WIDTH = 4  # steering, throttle, brake, buttons


@dataclass(frozen=True)
class CalledOpponent:
    """Any function of what karts see, such as another learner's policy.

    decide: from observations (n, size), those of `preset`, to controls (n, 4) as a live driver
    sends them: steering [-1, 1], throttle [-1, 1], brake [0, 1], buttons 0 to 3. What it remembers
    by itself is in no saved state.
    """

    decide: Callable[[Float32s], Any]
    preset: str = "radar"
    name: str = "called"

    def __str__(self) -> str:
        """Return its name, as that of a driver."""
        return self.name

    def driving(self, cockpits: Cockpits, layout: Layout) -> Callable[[], None]:
        """Return a call that fills the controls of all its karts. layout: of `preset`."""
        worlds, karts = cockpits.seats[:, 0], cockpits.seats[:, 1]
        views, controls, size = cockpits.observations, cockpits.controls, layout.size

        def drive() -> None:
            seen = views[worlds, karts, :size].astype(np.float32)
            controls[worlds, karts] = self._checked(self.decide(seen), len(seen))

        return drive

    def _checked(self, answers: Any, karts: int) -> Float32s:
        numbers = np.asarray(answers, np.float32)
        if numbers.shape != (karts, WIDTH) or not np.isfinite(numbers).all():
            raise DriverError(
                f"opponent {self.name} answers {karts} karts with shape {numbers.shape}: give "
                f"{(karts, WIDTH)} finite numbers: steering, throttle, brake, buttons"
            )
        return numbers
