"""Whole races in one process, without a network."""

from race_server.core.driver import Driver, driver_named
from race_server.core.messages import Event, Phase
from race_server.core.observation import Observation
from race_server.live.local_drivers import briefing_for
from race_server.scenario.race import Scenario
from race_server.session.session import Session


def run_race(scenario: Scenario, names: list[str]) -> tuple[Session, list[Event]]:
    """Return the session after a race of the named drivers, and all its events."""
    session = Session("test", scenario)
    drivers: list[Driver] = []
    for seat, name in enumerate(names):
        driver = driver_named(name)
        session.join(name, driver.preset, wanted=seat)
        session.seats[seat].is_ready = True
        driver.reset(briefing_for(session, session.seats[seat]))
        drivers.append(driver)
    session.start()
    events: list[Event] = []
    turn = 0
    while session.phase is not Phase.FINISHED:
        session.observe()
        turn += 1
        for seat, driver in enumerate(drivers):
            layout = session.layout(driver.preset)
            control = driver.act(Observation(session.tick, layout, session.view(seat).copy()))
            session.receive_control(seat, session.epoch, turn, session.tick, control)
        events += session.advance(session.decision_ticks)
    return session, events
