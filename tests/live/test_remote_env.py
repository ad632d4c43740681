"""A race on a live server as a PettingZoo environment: the same numbers, other karts elsewhere."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from race_server.competition.launch import free_address
from race_server.core.messages import Button, Control, Status
from race_server.core.observation import layout_of
from race_server.core.vehicle_presets import TT02
from race_server.envs.actions import CONTINUOUS
from race_server.envs.parallel import KartRace
from race_server.envs.presets import task_on
from race_server.errors import LinkError, ScenarioError, SeatError
from race_server.live.client.remote_env import RemoteRace
from race_server.live.client.remote_kart import RemoteKart
from race_server.live.client.timing import ClientTiming
from race_server.live.server import LOCKSTEP, RaceServer
from race_server.net.transport import ServerLink
from race_server.scenario.race import Rules, Scenario
from race_server.session.session import Session
from support.courses import ring
from support.servers import LiveServer, running

pytestmark = pytest.mark.live


def test_a_stuck_kart_accepts_its_rescue_as_in_training() -> None:
    layout, said = layout_of("track", 0), list[Control]()
    values = np.zeros(layout.size, np.float32)
    values[layout.slices["rescue_offered"]] = 1.0
    frame = SimpleNamespace(epoch=1, acknowledged=0, tick=0, values=values)
    seat: Any = SimpleNamespace(
        welcome=SimpleNamespace(briefing=SimpleNamespace(vehicle=TT02), epoch=0),
        layout=layout,
        receive=lambda _: frame,
        answer=lambda *words: said.append(words[-1]),
    )
    kart = RemoteKart(seat)
    assert kart.begin(0.0)
    kart.answer(CONTINUOUS, np.array([0.5, 0.0, 0.0], np.float32))
    assert said[0].buttons == Button.ACCEPT_RESCUE


COURSE = ring(radius=3.0, half_width=0.7)
RULES = Rules(laps=1, countdown_s=0.2, items=False, finish_limit_s=20.0, limit_s=40.0)
IMPATIENT = ClientTiming(observation_timeout_s=0.3)
# Actions that add up from one decision to the next.
ADDED_UP = ("report_b", "increments")
EVERYTHING = {
    "progress": 1.0,
    "speed": 0.1,
    "contact": -0.3,
    "wall": -0.5,
    "crash": -10.0,
    "wrong_way": -0.5,
    "off_track": -0.2,
    "places": 1.0,
    "item": 0.1,
    "lap": 2.0,
    "finish": 10.0,
    "time": -0.01,
}


def scenario(karts: int, rules: Rules = RULES) -> Scenario:
    return Scenario(COURSE, karts=karts, seed=7, rules=rules)


@contextmanager
def served(race: Scenario, *, drivers: int, fillers: tuple[str, ...] = ()) -> Iterator[LiveServer]:
    """Serve one race after the other."""
    with ServerLink(free_address(), "race", race.karts) as link:
        server = RaceServer(Session("race", race), link, LOCKSTEP, fillers)
        with running(server, drivers, repeatedly=True) as live:
            yield live


@contextmanager
def joined(live: LiveServer, **options: Any) -> Iterator[RemoteRace]:
    race = RemoteRace(live.address, **options)
    try:
        yield race
    finally:
        race.close()


def towards_the_line(seen: Any, speed: float = 1.5) -> np.ndarray:
    """Follow the ring to the left: heading_error and lateral_offset of preset `track`."""
    steering = 0.3 - 1.5 * seen[6] - 1.0 * seen[5]
    return np.array([0.3 if seen[0] < speed else 0.0, np.clip(steering, -1, 1), 0], np.float32)


def wild(action: str, turn: int, agent: str) -> Any:
    """Brake, reverse, hit walls and karts, and press the button."""
    chance = np.random.default_rng((turn // 8, int(agent[-1])))
    if action == "discrete":
        return chance.integers(15)
    drive = chance.choice([1.0, 0.7, -0.5, -1.0], p=[0.5, 0.2, 0.15, 0.15])
    numbers = np.array([drive, chance.uniform(-1, 1), chance.integers(2)], np.float32)
    if action == "control":
        return np.array([numbers[1], drive, max(-drive, 0.0), numbers[2]], np.float32)
    return numbers[:2] if action in ADDED_UP else numbers


@pytest.mark.slow
def test_two_remote_karts_race_a_scripted_one_to_the_end_and_leave() -> None:
    with (
        served(scenario(3), drivers=2, fillers=("pure_pursuit",)) as live,
        joined(live, karts=2, reward=EVERYTHING) as race,
    ):
        seen, infos = race.reset()
        assert race.agents == ["kart_0", "kart_1"]
        assert infos["kart_1"] == {"seat": 1, "tick": 0}
        finishes = 0.0
        while race.agents:
            assert all(seen[agent] in race.observation_space(agent) for agent in race.agents)
            actions = {agent: towards_the_line(seen[agent]) for agent in race.agents}
            seen, rewards, over, cut, infos = race.step(actions)
            assert list(seen) == list(rewards) == list(over) == list(cut) == list(actions)
            assert not any(cut.values())
            finishes += sum(info["reward_terms"]["finish"] for info in infos.values())
        assert finishes == 2.0
        race.close()
    assert [row.status for row in live.results[0].standings] == [Status.FINISHED] * 3


def test_remote_karts_see_what_their_seats_see_in_a_local_session() -> None:
    with served(scenario(2), drivers=2) as live, joined(live, karts=2) as race:
        seen, _ = race.reset()
        alone = Session("race", scenario(2))
        for seat in range(2):
            alone.join("local", "track", wanted=seat)
        alone.start()
        for turn in range(1, 80):
            alone.observe()
            for seat in range(2):
                assert alone.view(seat).tobytes() == seen[f"kart_{seat}"].tobytes()
                drive, steering = 0.5 + 0.1 * seat, 0.2
                control = Control(np.float32(steering), np.float32(drive))
                alone.receive_control(seat, alone.epoch, turn, alone.tick, control)
            alone.advance(alone.decision_ticks)
            seen, *_ = race.step({f"kart_{k}": (0.5 + 0.1 * k, 0.2, 0.0) for k in range(2)})


@pytest.mark.parametrize(
    "action",
    [
        *ADDED_UP,
        *(
            pytest.param(each, marks=pytest.mark.slow)
            for each in ("continuous", "discrete", "control")
        ),
    ],
)
def test_a_remote_race_is_the_race_of_the_training_world(action: str) -> None:
    # The wire carries controls as float32; what an action adds up to is then not quite the same.
    tolerance = 1e-3 if action in ADDED_UP else 0.0
    task = task_on((scenario(3),), observation="track", reward=EVERYTHING, action=action)
    local = KartRace(task)
    with (
        served(scenario(3), drivers=3) as live,
        joined(live, karts=3, reward=EVERYTHING, action=action) as remote,
    ):
        here, _ = local.reset()
        there, _ = remote.reset()
        met = dict.fromkeys(EVERYTHING, 0.0)
        for turn in range(50 if action in ADDED_UP else 200):
            for agent in local.agents:
                np.testing.assert_allclose(there[agent], here[agent], rtol=0.0, atol=tolerance)
            # Now and then one of them says nothing.
            told = [agent for agent in local.agents if agent != "kart_2" or turn % 5]
            actions = {agent: wild(action, turn, agent) for agent in told}
            here, gained, over, _, infos = local.step(actions)
            there, gained_there, over_there, _, infos_there = remote.step(actions)
            assert over == over_there
            assert gained_there == pytest.approx(gained, abs=1e-3)
            for agent, info in infos_there.items():
                own = dict(zip(local.batch.terms, infos[agent]["reward_terms"], strict=True))
                for name, value in info["reward_terms"].items():
                    assert value == pytest.approx(own[name], abs=1e-3)
                    met[name] += abs(value)
    local.close()
    if action == "continuous":
        assert met["wall"]
        assert met["contact"]


def test_a_crash_is_known_in_the_step_in_which_the_kart_is_out() -> None:
    rules = replace(RULES, wall_contact="retire")
    with served(scenario(1, rules), drivers=1) as live, joined(live) as race:
        race.reset()
        crashes = 0.0
        while race.agents:
            _, rewards, over, _, infos = race.step({"kart_0": (1.0, -1.0, 0.0)})
            crashes += infos["kart_0"]["reward_terms"]["crash"]
            assert over["kart_0"] == (crashes > 0.0) == (rewards["kart_0"] < -1.0)
    assert crashes == 1.0


def test_an_action_that_is_none_is_refused_and_the_race_goes_on() -> None:
    with served(scenario(1), drivers=1) as live, joined(live) as race:
        race.reset()
        for wrong in ({"kart_0": (1.0,)}, {"kart_0": (np.nan, 0.0, 0.0)}, {"kart_9": 0.0}, None):
            with pytest.raises(ScenarioError, match=r"^actions? .*: (give|choose of kart_0)"):
                race.step(wrong)  # type: ignore[arg-type]
        race.step({"kart_0": (1.0, 0.0, 0.0)})
        assert race.agents == ["kart_0"]


def test_the_next_reset_waits_for_the_next_race_even_in_the_middle_of_one() -> None:
    with (
        served(scenario(2), drivers=1, fillers=("pure_pursuit",)) as live,
        joined(live, seats=(1,), observation="lidar", reward={"range": 1.0}) as race,
    ):
        space = race.observation_space("kart_0")
        assert space is race.observation_space("kart_0")
        for _ in range(2):
            seen, infos = race.reset()
            assert seen["kart_0"] in space
            assert infos["kart_0"] == {"seat": 1, "tick": 0}
            for _ in range(10):
                *_, infos = race.step({"kart_0": (1.0, 0.0, 0.0)})
            assert 0.0 < infos["kart_0"]["reward_terms"]["range"] < 8.0
            assert "progress" not in infos["kart_0"]["reward_terms"]
    assert live.results[0].standings[-1].status is Status.RETIRED


def test_an_agent_whose_seat_is_lost_is_truncated_and_the_others_race_on() -> None:
    with (
        served(scenario(2), drivers=2) as live,
        joined(live, karts=2, timing=IMPATIENT) as race,
    ):
        race.reset()
        race.step({})
        seats = live.server.session.seats
        seats[1].key, seats[1].is_present = b"", False
        _, rewards, over, cut, _ = race.step({})
        assert cut == {"kart_0": False, "kart_1": True}
        assert not any(over.values())
        assert rewards["kart_1"] == 0.0
        assert list(race.step({})[0]) == ["kart_0"]


def test_a_seat_that_was_given_up_for_silence_is_asked_for_again() -> None:
    with (
        served(scenario(2), drivers=2) as live,
        joined(live, karts=2, timing=IMPATIENT) as race,
    ):
        race.reset()
        live.server.session.drop(1)
        *_, cut, _ = race.step({})
        assert not any(cut.values())


def step_often(race: RemoteRace) -> None:
    for _ in range(3):  # what was under way may still arrive
        race.step({})


def test_a_server_that_goes_away_ends_the_step_with_a_clear_error() -> None:
    with served(scenario(1), drivers=1) as live, joined(live, timeout_s=0.5) as race:
        race.reset()
        live.stop()
        live.server.link.close()
        with pytest.raises(LinkError, match=r"no observation for 0\.5 s: the server at tcp"):
            step_often(race)


def test_no_server_and_no_seat_say_so() -> None:
    with pytest.raises(LinkError, match="no server answers at"):
        RemoteRace(free_address(), timeout_s=0.5).reset()
    with (
        served(scenario(1), drivers=9) as live,
        pytest.raises(SeatError, match="all 1 seats are taken"),
    ):
        RemoteRace(live.address, karts=2).reset()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"reward": "report_b"}, "reward term 'range' cannot be known from .*'track'"),
        ({"reward": {"lead": 1.0}}, "'lead' cannot be known .*'track': choose another reward"),
        (
            {"reward": {"range": 1.0}},
            "'range' cannot be known .* choose one of lidar, lot_lidar, full",
        ),
        (
            {"observation": "lidar"},
            "'progress' cannot be known .* choose one of track, line, radar_line, rivals",
        ),
        ({"reward": {"beauty": 1.0}}, "reward term 'beauty' is unknown"),
        (
            {"observation": "report_b"},
            "a server gives one of lidar, radar, track, line, radar_line, rivals, lot, lot_lidar, "
            "lot_trailer, full",
        ),
        ({"seats": (0, 1)}, "2 seats for 1 karts"),
        ({"action": "residual"}, "action 'residual' advises a driver inside the world"),
        ({"action": "telepathy"}, "action 'telepathy' is unknown"),
    ],
)
def test_what_a_live_race_cannot_give_is_refused(options: dict[str, Any], message: str) -> None:
    with pytest.raises(ScenarioError, match=message):
        RemoteRace("tcp/127.0.0.1:9", **options)
