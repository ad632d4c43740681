"""A screen beside the driver of a real kart, on the kart's machine: it needs no server."""

import threading
from collections.abc import Iterator
from contextlib import closing, contextmanager

import pytest

from race_agents.onboard.beside import Beside
from race_agents.unit.records import Report
from race_server.competition.launch import free_address
from race_server.core.messages import Pose
from race_server.errors import LinkError
from race_server.live.gateway.roles import Tokens
from race_server.net.wire.alert import decode_alert
from race_server.net.wire.pose import decode_pose
from support.browsers import Browser
from support.chromium import NEEDS_CHROMIUM, Stage, chromium
from support.messages import ALERT
from support.served_race import ServedRace, gated

pytestmark = [*NEEDS_CHROMIUM, pytest.mark.usefixtures("private_folders")]

TOKENS = Tokens(companion=((0, "beside 0"), (1, "beside 1")))
# It drives 36 km/h and brakes for a person 4.5 m ahead.
BRAKING = Report(Pose(1, 2.0, 3.0, 0.5, 10.0), ALERT)


@contextmanager
def telling(address: str) -> Iterator[None]:
    """Let the kart of seat 1 tell what it knows, fifty times a second."""
    has_ended = threading.Event()

    def tell() -> None:
        with closing(Beside(address, "race", 1)) as beside:
            while not has_ended.wait(0.02):
                beside.tell(BRAKING)

    thread = threading.Thread(target=tell)
    thread.start()
    try:
        yield
    finally:
        has_ended.set()
        thread.join(10.0)


@pytest.fixture
def gateway() -> Iterator[ServedRace]:
    """A gateway beside a kart, where no server answers."""
    with gated(free_address(), tokens=TOKENS, kart=free_address()) as served:
        yield served


def test_without_a_server_a_companion_sees_what_its_kart_says(gateway: ServedRace) -> None:
    with (
        Browser(gateway.base, {"role": "companion", "token": "beside 1"}) as beside,
        Browser(gateway.base, {"role": "companion", "token": "beside 0"}) as elsewhere,
    ):
        assert beside.word("welcome")["seat"] == 1
        assert beside.word("notice")["code"] == "no-race"
        with telling(gateway.state.settings.kart):  # it comes later than its screen
            alert, pose = beside.frame(b"RALR"), beside.frame(b"RPOS")
        assert decode_alert(alert).alert == ALERT
        assert decode_pose(pose).pose == BRAKING.pose
        assert elsewhere.word("welcome")["seat"] == 0
        assert elsewhere.frames == []


def test_the_page_shows_it_and_forgets_it_once_the_kart_is_silent(
    gateway: ServedRace,
) -> None:
    with chromium() as browser:
        stage = Stage(gateway, browser)
        page = stage.open("beside&token=beside 1")
        with telling(gateway.state.settings.kart):
            page.get_by_text("Your kart brakes: person 4.5 m on the left").wait_for()
            assert page.get_by_test_id("speed").inner_text().split() == ["36", "km/h"]
            page.get_by_text("Bad link").wait_for()
        page.get_by_test_id("speed").wait_for(state="detached")
        assert stage.troubles == []


def test_a_kart_tells_programs_of_its_own_machine_only() -> None:
    with pytest.raises(LinkError, match="on its own machine only"):
        Beside("tcp/0.0.0.0:7450", "race", 1)
