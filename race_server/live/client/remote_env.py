"""A race on a live server as a PettingZoo parallel environment: its agents drive some karts."""

import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import cached_property, partial
from typing import Any, ClassVar

from gymnasium import spaces

from race_server.core.messages import EventKind
from race_server.core.observation import PRESETS, layout_of
from race_server.core.state import Floats
from race_server.envs.action_shapes import action_as
from race_server.envs.actions import RESIDUAL, action_kind
from race_server.envs.kart_agents import KartAgents, Vector
from race_server.envs.racing.reward_terms import TERMS, reward_weights
from race_server.envs.spaces import observation_space
from race_server.errors import LinkError, ScenarioError, SeatError
from race_server.live.client.remote_kart import RaceEvents, RemoteKart
from race_server.live.client.seat import ClientSeat, insist, take_seat
from race_server.live.client.timing import ClientTiming
from race_server.net.transport import ClientLink
from race_server.net.wire import topics
from race_server.net.wire.lobby import Join, decode_course, decode_rules
from race_server.net.wire.sheets import LOCKSTEP

_TERMS = tuple(TERMS)
# Observation parts that a term needs, where not every preset has them.
_NEEDS = {"progress": "progress", "range": "lidar", "lead": "all karts"}


class RemoteRace(KartAgents):
    """The race of a server in lock-step; agents are `kart_0` … of the karts driven here.

    An agent leaves `agents` terminated when its race is over, truncated when time ran out or its
    seat is lost. Observations, actions and reward terms mean what they mean in `KartRace`. The
    seats are held from the first `reset` until `close`.
    """

    metadata: ClassVar[dict[str, Any]] = {
        "name": "remote_race_v0",
        "render_modes": [],
        "is_parallelizable": True,
    }
    render_mode = None

    def __init__(
        self,
        address: str,
        session: str = "race",
        *,
        karts: int = 1,
        seats: Sequence[int] = (),
        observation: str = "track",
        reward: str | Mapping[str, float] = "progress",
        action: str = "continuous",
        timeout_s: float = 20.0,
        timing: ClientTiming | None = None,
    ) -> None:
        """Prepare to join; nothing is connected before the first `reset`.

        Args:
            address: of the server.
            session: the server's session.
            karts: how many karts are driven here.
            seats: the seats wanted, one for each kart; without them the server chooses.
            observation: preset that all agents see.
            reward: preset or weights of the reward terms.
            action: what an action means.
            timeout_s: without an answer of the server for this long [s] it has gone.
            timing: timeouts and periods during a race.

        Raises:
            ScenarioError: an observation, a reward or an action that a live race cannot give.
        """
        if observation not in PRESETS:
            known = ", ".join(PRESETS)
            raise ScenarioError(f"observation {observation!r}: a server gives one of {known}")
        if karts < 1 or (seats and len(seats) != karts):
            raise ScenarioError(f"{len(seats)} seats for {karts} karts: name one for each, or none")
        self.address, self.session, self.timeout_s = address, session, timeout_s
        super().__init__(karts, action)
        self._timing = timing or ClientTiming()
        self._wanted = tuple(seats) or (-1,) * karts
        self._preset = observation
        self._weights = reward_weights(reward)
        self._terms = _known_terms(observation, self._weights)
        self._action = action_kind(action)
        if self._action == RESIDUAL:
            raise ScenarioError(
                "action 'residual' advises a driver inside the world, and a live race has none "
                "there: choose another, or drive `learned:NAME`"
            )
        self._link: ClientLink | None = None
        self._karts: dict[str, RemoteKart] = {}

    @cached_property
    def observation_spaces(self) -> dict[str, spaces.Space[Any]]:
        """What each agent may see. Takes the seats where only the server knows the lidar's rays."""
        rays = 0
        if "lidar" in PRESETS[self._preset]:
            self._join()
            rays = self._karts[self.possible_agents[0]].seat.welcome.lidar_rays
        layout = layout_of(self._preset, rays)
        return {agent: observation_space(layout) for agent in self.possible_agents}

    # The race

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Vector], dict[str, dict[str, Any]]]:
        """Wait for the next race of the server and return the first observations.

        The seed is ignored: the server has its own. Options are not used. Karts that still race
        withdraw. A lobby may wait for other drivers, so this waits as long as the server answers.

        Raises:
            LinkError: no server, or it does not answer for `timeout_s`.
            SeatError: no seat.
        """
        self._join()
        for agent in self.agents:
            with suppress(LinkError, SeatError):
                self._karts[agent].seat.act(topics.LEAVE)
        self.agents = []
        self._wait_for_start()
        self.agents = list(self.possible_agents)
        karts = self._karts
        self._events.begin(max(kart.epoch for kart in karts.values()))
        seen = {agent: kart.seen.values.copy() for agent, kart in karts.items()}
        return seen, {agent: kart.info() for agent, kart in karts.items()}

    def step(
        self, actions: dict[str, Any]
    ) -> tuple[
        dict[str, Vector],
        dict[str, float],
        dict[str, bool],
        dict[str, bool],
        dict[str, dict[str, Any]],
    ]:
        """Send the control of every agent and wait for the next observation of all.

        An agent without an action coasts with its steering straight.

        Raises:
            LinkError: no agent receives anything for `timeout_s`.
            ScenarioError: actions are not given by the names of agents, or one has another shape
                or is no number; none is sent then.
        """
        self.check_actions(actions)
        karts = {agent: self._karts[agent] for agent in self.agents}
        rest, width = self._rest, len(self._rest)
        given = [action_as(actions.get(agent, rest), width, agent) for agent in karts]
        for kart, action in zip(karts.values(), given, strict=True):
            kart.answer(self._action, action)
        lost = self._receive_all()
        self._catch_up(lost)
        rewards, infos = {}, {}
        for agent, kart in karts.items():
            terms = kart.measure(self._length)
            rewards[agent] = float(self._weights @ terms)
            named = {name: float(terms[place]) for name, place in self._terms.items()}
            infos[agent] = {**kart.info(), "reward_terms": named}
        seen = {agent: kart.seen.values.copy() for agent, kart in karts.items()}
        cut = {agent: agent in lost or kart.is_late for agent, kart in karts.items()}
        over = {agent: kart.is_done and not cut[agent] for agent, kart in karts.items()}
        self.agents = [agent for agent in karts if not over[agent] and not cut[agent]]
        return seen, rewards, over, cut, infos

    def close(self) -> None:
        """Leave the seats and close the link; a race that runs goes on without these karts."""
        link, self._link = self._link, None
        karts, self._karts = self._karts, {}
        self.agents = []
        if link is None:
            return
        with link, suppress(LinkError):
            for kart in karts.values():
                with suppress(SeatError):
                    kart.seat.act(topics.LEAVE)

    # The server

    def _join(self) -> None:
        """Take all seats, unless they are held."""
        if self._link is not None:
            return
        deadline = time.monotonic() + self.timeout_s
        self._link = link = ClientLink(self.address, self.session, timeout_s=self.timeout_s)
        try:
            for agent, wanted in zip(self.possible_agents, self._wanted, strict=True):
                join = Join(f"remote {agent}", self._preset, wanted)
                self._karts[agent] = RemoteKart(insist(partial(take_seat, link, join), deadline))
            sheet = decode_course(insist(partial(link.ask, topics.COURSE), deadline))
            rules, _ = decode_rules(insist(partial(link.ask, topics.RULES), deadline))
        except Exception:
            self.close()
            raise
        self._length = sheet.spacing * len(sheet.line)
        # A server in real time answers fewer requests for events than there are decisions.
        self._asks_at_once = rules.get(LOCKSTEP) == str(True)
        self._events = RaceEvents(link)

    def _wait_for_start(self) -> None:
        waiting = dict(self._karts)
        again = 0.0
        while waiting:
            if time.monotonic() > again:
                self._get_ready()
                again = time.monotonic() + self._timing.ready_s
            for agent, kart in tuple(waiting.items()):
                if kart.begin(self._timing.poll_s):
                    del waiting[agent]

    def _get_ready(self) -> None:
        """Ask for all seats, then report all ready: a race waits for every seat that is taken."""
        deadline = time.monotonic() + self.timeout_s
        for kart in self._karts.values():
            # A server that was started again counts its races from one.
            kart.epoch = min(kart.epoch, insist(kart.seat.ask_again, deadline).epoch)
        for kart in self._karts.values():
            insist(partial(kart.seat.act, topics.READY), deadline)

    def _receive_all(self) -> set[str]:
        """Wait until every agent has a later observation; return those whose seat is lost."""
        waiting = {agent: self._karts[agent] for agent in self.agents}
        lost: set[str] = set()
        last = asked = time.monotonic()
        while waiting:
            for agent, kart in tuple(waiting.items()):
                if kart.receive(self._timing.poll_s):
                    del waiting[agent]
                    last = asked = time.monotonic()
            now = time.monotonic()
            if waiting and now - last > self.timeout_s:
                if len(waiting) == len(self.agents):
                    raise LinkError(
                        f"no observation for {self.timeout_s:g} s: the server at {self.address} "
                        "has gone, or waits for another driver"
                    )
                return lost | set(waiting)
            if now - asked > self._timing.observation_timeout_s:
                refused = {agent for agent, kart in waiting.items() if _is_refused(kart.seat)}
                waiting = {agent: waiting[agent] for agent in waiting if agent not in refused}
                lost |= refused
                asked = time.monotonic()
        return lost

    def _catch_up(self, lost: set[str]) -> None:
        """Receive all events so far: no reward may depend on which message came first."""
        karts = [self._karts[agent] for agent in self.agents if agent not in lost]
        ended = {kart.seat.number for kart in karts if kart.is_done}
        if len(ended) < len(karts):
            with suppress(LinkError):  # the next step notices
                link = karts[0].seat.link
                self._events.receive(link.ask(topics.RECENT, at_once=self._asks_at_once))
        # A race that is over answers no queries, but publishes how it ended.
        for event in self._events.wait_for(ended, self._timing.final_event_s):
            met = {event.kart, event.other if event.kind is EventKind.CONTACT_KART else -1}
            for kart in self._karts.values():
                if kart.seat.number in met:
                    kart.events.append(event)


def _known_terms(preset: str, weights: Floats) -> dict[str, int]:
    """Return the terms that can be known from an observation, with their places.

    Raises:
        ScenarioError: another term has a weight.
    """
    known = {}
    for place, name in enumerate(_TERMS):
        part = _NEEDS.get(name)
        if part is None or part in PRESETS[preset]:
            known[name] = place
        elif weights[place] != 0.0:
            able = ", ".join(other for other, parts in PRESETS.items() if part in parts)
            choice = f"choose one of {able}, or another reward" if able else "choose another reward"
            raise ScenarioError(
                f"reward term {name!r} cannot be known from observation {preset!r}: {choice}"
            )
    return known


def _is_refused(seat: ClientSeat) -> bool:
    """Ask for a silent seat again; True where the server refuses it."""
    try:
        seat.ask_again()
    except SeatError:
        return True
    except LinkError:
        return False  # no answer: zenoh goes on trying to connect
    return False
