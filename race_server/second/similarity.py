"""How large and how slow things are in another simulator, beside ours."""

import math
from collections.abc import Iterable
from dataclasses import dataclass

from race_server.core.vehicles import Vehicle
from race_server.errors import ScenarioError
from race_server.scenario.track.highway_roads import TENTH


@dataclass(frozen=True)
class Similarity:
    """Lengths and times there that are one here."""

    length: float = 1.0  # metres there that are one here
    time: float = 1.0  # seconds there that are one here

    @classmethod
    def of(cls, vehicles: Iterable[Vehicle]) -> "Similarity":
        """Return that of karts and cars: none; or of model cars, at equal accelerations.

        Model cars are ten times larger there, and all takes √10 times as long: Froude's similarity,
        in which accelerations and angles are equal.

        Raises:
            ScenarioError: there are both.
        """
        short = {vehicle.is_model_car for vehicle in vehicles}
        if len(short) > 1:
            raise ScenarioError(
                "model cars and karts in one task: another simulator takes either; leave one out"
            )
        return cls(TENTH, math.sqrt(TENTH)) if True in short else cls()

    @property
    def pace(self) -> float:
        """Speed there [m/s] that is one here."""
        return self.length / self.time
