"""A real kart before its race begins: a driver that fails, a server that goes."""

import pytest

from race_agents.onboard.client import take_part
from race_agents.onboard.kart import KartHere
from race_agents.onboard.program import KartProgram
from race_server.competition.launch import free_address
from race_server.errors import DriverError, LinkError
from race_server.live.server import RaceServer
from race_server.net.transport import ServerLink
from support.real_karts import Gentle, kart_of
from support.servers import running
from support.sessions import session_on_ring

pytestmark = pytest.mark.live


def test_a_real_kart_gives_up_where_the_server_goes_before_the_race_begins(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("race_agents.onboard.client.RETRY_S", 0.1)
    monkeypatch.setattr("race_agents.onboard.program.AWAY_S", 1.0)
    monkeypatch.setattr("race_server.net.transport.client.QUERY_TIMEOUT_S", 0.2)
    session, address = session_on_ring("race", karts=2), free_address()
    turns: list[float] = []
    with ServerLink(address, "race", 1) as link, running(RaceServer(session, link), 2) as live:

        def turn(onboard: KartProgram, kart: KartHere, now_s: float) -> bool:
            del onboard
            assert kart.side.unit.hud is None  # the other driver is not there yet
            turns.append(now_s)
            if now_s - turns[0] > 2.0:  # twice as long as it waits for an answer
                live.server.stop()
            return now_s - turns[0] < 30.0

        with pytest.raises(LinkError, match="gone"):
            take_part(Gentle(), kart_of, name="real", address=address, each_turn=turn)
    assert 2.9 < turns[-1] - turns[0] < 6.0


def test_a_kart_whose_driver_does_not_get_ready_is_left_with_its_brakes_on() -> None:
    class Absent(Gentle):
        def reset(self, briefing: object) -> None:
            raise DriverError("no driver")

    closed: list[float] = []

    def kart_that_is_closed(*given: object) -> KartHere:
        kart = kart_of(*given)  # type: ignore[arg-type]
        monitored = kart.close
        kart.close = lambda: (monitored(), closed.append(1.0))  # type: ignore[method-assign]
        return kart

    session, address = session_on_ring("race", karts=1), free_address()
    with (
        ServerLink(address, "race", 1) as link,
        running(RaceServer(session, link), 1),
        pytest.raises(DriverError, match="no driver"),
    ):
        take_part(Absent(), kart_that_is_closed, name="real", address=address)
    assert closed == [1.0]
