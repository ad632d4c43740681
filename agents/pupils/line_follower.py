"""The hands of a simulated pupil: follows a line at exactly its speeds, whatever they are.

A driver that races adds margins to a line: it brakes earlier, keeps clear of borders, slows down
where a line turns over. They would hide the very faults that a pupil has. Speeds are those of a
line that a driver has driven, so no margin is needed.
"""

from race_agents.planning.delay_compensation import look_ahead
from race_agents.planning.latency import remember_command
from race_agents.planning.tactics import SPEED
from race_agents.planning.tracking import (
    LINE_SPEED,
    SPEED_GAIN,
    STEP,
    at_distance,
    press_for,
    steering_on_line,
)
from race_agents.planning.tyre_slip import watch_slip
from race_server.core.driver import Briefing
from race_server.core.kernel_driver import DECISION, Cockpit, cockpit_for
from race_server.core.messages import Control
from race_server.core.observation import Observation


class LineFollower:
    """Follows the reference line at its speeds, alone on the course."""

    preset = "line"

    def reset(self, briefing: Briefing) -> None:
        """Get ready for a lap."""
        self._briefing = briefing
        self._cockpit: Cockpit | None = None

    def act(self, observation: Observation) -> Control:
        """Return what to do until the next observation."""
        if self._cockpit is None:
            self._cockpit = cockpit_for(self._briefing, observation.layout)
        cockpit = self._cockpit
        cockpit.observation[:] = observation.values
        watch_slip(cockpit)
        look_ahead(cockpit)
        force = press_for(cockpit, _acceleration(cockpit))
        cockpit.control[0] = steering_on_line(cockpit, 0.0, force)
        remember_command(cockpit.memory, cockpit.control)
        steering, throttle, brake, _ = (float(value) for value in cockpit.control)
        return Control(steering, throttle, brake)


def _acceleration(cockpit: Cockpit) -> float:
    """Return the acceleration [m/s²] that holds the speeds of the line."""
    seen, offsets = cockpit.observation, cockpit.offsets
    speed, step = float(seen[offsets[SPEED]]), float(cockpit.setup[DECISION])
    ahead = speed * step / max(float(seen[offsets[STEP]]), 0.01)
    now, soon = (at_distance(seen, offsets[LINE_SPEED], place) for place in (0.0, ahead))
    return float((soon - now) / step + SPEED_GAIN * (now - speed))
