"""Learns the course while it drives: maps one lap, then races the fastest line of its map.

The lap is driven by `follow_gap`, and the line by `raceline`, whose observation is made from the
pose that the lidar tells on the map.
"""

from race_agents.drivers.follow_gap import FollowGap
from race_agents.drivers.raceline import Raceline
from race_agents.planning.charting import Charting
from race_agents.planning.line_view import LAYOUT
from race_server.core.driver import Briefing
from race_server.core.messages import Control
from race_server.core.observation import Observation
from race_server.core.vehicle_presets import TENTH


class Mapper:
    """Learns the course in its first lap and races the fastest line of its map from then on."""

    preset = "lidar"
    vehicles = TENTH  # a kart sees no further than eight metres: too few walls to fit a scan to

    def reset(self, briefing: Briefing) -> None:
        """Get ready for a new race, with nothing known of the course."""
        self._charting = Charting(briefing)
        self._reactive, self._tracker = FollowGap(), Raceline()
        self._reactive.reset(briefing)
        self._tracker.reset(briefing)
        self._tracker.prepare(LAYOUT)  # in the race there is no time to compile

    def act(self, observation: Observation) -> Control:
        """Return what to do until the next observation."""
        seen = self._charting.look(observation)
        return self._reactive.act(observation) if seen is None else self._tracker.act(seen)
