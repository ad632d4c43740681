"""Meetings of karts: by what the radar sees alone, and with what the other karts tell.

Each has a danger that a radar shows late: a kart ahead brakes as hard as this one can; one comes
across from behind karts that are parked; one stands behind another one, which leaves the way.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial

from race_agents.plant.encounter import DRIVES, FOLLOWS, KMH, Case, meet
from race_agents.plant.matrices import BOUND_BRAKING, SHARES, SPEEDS, parked_beside
from race_agents.plant.moves import brakes, crosses, goes_ahead, leaves
from race_agents.plant.radar import ERRS
from race_agents.plant.row import Row
from race_agents.plant.sensors import Sensors
from race_agents.plant.whereabouts import Setting
from race_server.core.vehicles import Vehicle

CLOSE = 6.0  # [m] behind a kart that brakes
# A kart leaves the way by this much more than its width [m], within this time [s].
ROOM, SWERVE_S = 0.3, 0.6
BRAKE = "kart ahead brakes fully, {:g} m ahead"
CROSS, BEHIND = "kart crosses from behind parked karts", "kart stands behind one that swerves out"


def meetings(vehicle: Vehicle) -> Iterator[Case]:
    """Yield the meetings, 10 to 60 km/h."""
    width, length = vehicle.width, vehicle.length
    parked = parked_beside(vehicle)
    for speed in SPEEDS:
        for follows in (FOLLOWS, CLOSE):
            slows = partial(
                brakes, speed=speed, length=length, follows=follows, braking=BOUND_BRAKING
            )
            yield Case(BRAKE.format(follows), speed, slows, None)
        for share in SHARES:
            at = (share - 0.5) * width
            comes = partial(crosses, pace=DRIVES, side=-1.0, at=at, x=0.5 * width)
            yield Case(CROSS, speed, comes, None, parked)
        stands = partial(goes_ahead, pace=0.0, at=0.0, x=0.5 * length)
        way = {"speed": speed, "length": length, "follows": FOLLOWS}
        swerves = partial(leaves, **way, aside=width + ROOM, over_s=SWERVE_S)
        yield Case(BEHIND, speed, stands, None, before=swerves)


@dataclass
class Tally:
    """How some meetings went."""

    meetings: int = 0
    hits: int = 0
    worst: float = 0.0  # [m/s] at impact
    impacts: float = 0.0  # [m/s] of all together

    @property
    def avoided(self) -> float:
        """Share of them in which nothing was touched."""
        return 1.0 - self.hits / max(self.meetings, 1)

    @property
    def note(self) -> str:
        """What else is to be said."""
        mean = self.impacts / max(self.meetings, 1)
        return (
            f"{self.meetings - self.hits} of {self.meetings}; impact {mean / KMH:.1f} km/h in the "
            f"mean of all, {self.worst / KMH:.0f} at most"
        )


def rows(setting: Setting) -> list[Row]:
    """Return the table: each matrix by the radar alone, and with what the others tell."""
    sensors, builds = Sensors(radar=ERRS), min(setting.seeds, 3)
    tallies: dict[tuple[str, bool], Tally] = {}
    for case in meetings(setting.vehicle):
        for told in (False, True):
            tally = tallies.setdefault((case.name, told), Tally())
            for seed in range(builds):
                impact = meet(case, setting.vehicle, sensors, seed, told=told).impact
                tally.meetings += 1
                tally.hits += impact is not None
                tally.worst = max(tally.worst, impact or 0.0)
                tally.impacts += impact or 0.0
        setting.tell()
    result = []
    for name in dict.fromkeys(name for name, _ in tallies):
        alone, both = tallies[name, False], tallies[name, True]
        for text, tally in (("radar alone", alone), ("with what karts tell", both)):
            least = 0.0 if tally is alone else alone.avoided
            result.append(
                Row(f"{name}: avoided, {text}", "share", tally.avoided, least, note=tally.note)
            )
    return result
