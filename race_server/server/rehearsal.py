"""Everything that a race needs, done once before anybody waits for it."""

from race_server.messages import Flag
from race_server.scenario.base import Scenario
from race_server.session import Session


def warm_up(scenario: Scenario) -> None:
    """Compile, or load, every kernel of a race; nothing may do so while karts are on the track."""
    rehearsal = Session("rehearsal", scenario)
    rehearsal.join("nobody", "full")
    rehearsal.start()
    rehearsal.look()
    rehearsal.advance(1)
    rehearsal.show_flag(Flag.YELLOW)
    rehearsal.penalise(0, 1.0)
    rehearsal.leave(0)
