"""Settings of a training in which vehicles learn to park."""

from typing import Literal

from pydantic import Field

from race_agents.training.settings_table import Table


class ParkingSettings(Table):
    """Vehicles that drive to slots of lots instead of a race; without lots there are none.

    Of `race` they keep karts, learners, opponents and fields, and those rules that a lot has.
    """

    lots: tuple[str, ...] = ()
    level: str = ""  # of tolerance, see `race_server.scenario.level`; none: that of each lot
    limit_s: float = Field(default=0.0, ge=0.0)  # of an episode; 0: that of each lot
    late_ends: bool = False  # time that runs out is an end, not a cut
    # All that learn get the mean of their rewards, until the last of them is done; `poca` takes the
    # mean by itself.
    team: bool = False
    decision_ticks: int = Field(default=6, ge=1, le=60)  # of 1/60 s
    # A network sees logarithms of the radar's ranges, and of the metres to the slot and to movers.
    logarithms: bool = False
    # Of the way to the slot, and how it helps to learn; see `race_server.envs.parking.heuristics`.
    # Without one it is 'none', in quotation marks behind `--set`, where a bare none is the default.
    heuristic: str = "euclid"
    shaping: Literal["difference", "potential", "hurl"] = "difference"


class HurlSettings(Table):
    """What a heuristic promises, where `parking.shaping` is hurl; see `agents/training/hurl.py`."""

    # The mixing at the beginning; at the end it is 1.
    first: float = Field(default=0.95, ge=0.0, le=1.0)
    epochs: int = Field(default=50, ge=2)  # of the training, in each of which it is constant
    prize: float = 1.0  # return at the slot
    cost: float = Field(default=0.0, ge=0.0)  # of a decision until then
    speed: float = Field(default=1.0, gt=0.0)  # [m/s] at which the way is driven
