"""Forbidden requests: for seats of others, forged, repeated, and those of the steward."""

from race_server.core.messages import Flag
from race_server.errors import Reason, SeatError
from race_server.live.client.steward import StewardClient
from race_server.net.wire import topics
from race_server.net.wire.admin import Decision, decode_log, encode_decision
from race_server.net.wire.lobby import (
    PROTOCOL,
    Join,
    SeatAct,
    check_reply,
    encode_join,
    encode_seat_act,
    new_serial,
)
from race_server.tools.drills.intruder import Intruder, key
from race_server.tools.drills.scene import Scene

INVENTIONS = "abcdefgh"


def refusal_of(answer: bytes | None) -> str:
    """Return why the server refused, "" if it did not."""
    if answer is None or answer[4:8] != b"RRPL":
        return ""
    try:
        check_reply(answer)
    except SeatError as error:
        return str(error)
    return ""


def _deny(scene: Scene, act: str, answer: bytes | None) -> None:
    """Record a request that the server itself has to refuse, with its reason."""
    granted = "granted" if answer else "no answer"
    scene.deny(act, "" if refusal_of(answer) else granted)


def _allow(scene: Scene, act: str, answer: bytes | None) -> None:
    scene.allow(act, (refusal_of(answer) if answer else "no answer"))


def try_requests(scene: Scene) -> None:
    """Try requests on keys of others."""
    with _as(scene, "seat-0") as seat, _as(scene, "spectator") as spectator:
        join = encode_join(Join("thief", "track", 1))
        for act, who, name in (
            ("join on another seat's key", seat, "q/join/1"),
            ("join on any seat", seat, "q/join/any"),
            ("join on all seats", seat, "q/join/*"),
            ("join as spectator", spectator, "q/join/1"),
            ("make another seat ready", seat, "q/ready/1"),
            ("leave for another seat", seat, "q/leave/1"),
            ("ask everything at once", seat, "**"),
        ):
            scene.deny(act, "answered" if who.ask(key(name), join) else "")
        # Each client may read its own settings: this asks for the server's.
        server = next(iter(spectator.session.info.routers_zid()))
        space = spectator.ask(f"@/{server}/**")
        scene.deny("read zenoh's own settings", "answered" if space else "")
        # A client that offers to answer in the server's place is not asked.
        spectator.session.declare_queryable(
            key("q/rules"), lambda query: query.reply(query.key_expr, b"forged")
        )
        answers = {scene.spectator.ask(topics.RULES) for _ in range(5)}
        scene.deny("answer in the server's place", "believed" if b"forged" in answers else "")


def try_forgery(scene: Scene) -> None:
    """Try messages that pretend to come from others, or are copies."""
    own, other = scene.drivers[0].welcome.secret, scene.drivers[1].welcome.secret
    with _as(scene, "seat-0") as seat:
        ready, join = key("q/ready/0"), key("q/join/0")
        for act, name, data in (
            ("forged seat in a message", ready, encode_seat_act(SeatAct(1, other))),
            ("forged seat in a join", join, encode_join(Join("thief", "track", 1))),
            ("secret of another seat", join, encode_join(Join("thief", "track", 0, other))),
            ("wrong secret", ready, encode_seat_act(SeatAct(0, 12345))),
            ("a name with an escape", join, encode_join(Join("\x1b[2J", "track", 0))),
            ("a name with a mark of direction", join, encode_join(Join("\u202eann", "track", 0))),
            ("a name of two lines", join, encode_join(Join("ann\nbob", "track", 0))),
            ("a name of 33 letters", join, encode_join(Join("名" * 33, "track", 0))),
            ("another version", join, encode_join(Join("old", "track", 0, version=PROTOCOL - 1))),
            ("rubbish", join, b"rubbish"),
        ):
            _deny(scene, act, seat.ask(name, data))
        for act, name, data in (
            ("join", join, encode_join(Join("honest 0", "track", 0, own, new_serial()))),
            ("ready", ready, encode_seat_act(SeatAct(0, own, serial=new_serial()))),
        ):
            _allow(scene, f"{act} with a new serial", seat.ask(name, data))
            _deny(scene, f"the same {act} again", seat.ask(name, data))
        _try_invention(scene, seat)


def _try_invention(scene: Scene, seat: Intruder) -> None:
    """Try to have refusals counted under words of the sender: each has an escaped quote."""
    refused = scene.served.server.counters.refused
    before = set(refused)
    for letter in INVENTIONS:
        seat.ask(key("q/join/0"), encode_join(Join("thief", f"{letter}\\", 0)))
    new = set(refused) - before
    seen = f"{len(new)} new reasons" if len(new) > 1 or new - set(Reason) else ""
    scene.deny("reasons made up by a sender", seen)


def try_steward(scene: Scene) -> None:
    """Try decisions of the steward as others, without the token, and repeated."""
    session, token = scene.served.server.session, scene.served.keys("steward").token
    with scene.served.link("steward") as link:
        steward = StewardClient(link, token)
        challenge, _ = decode_log(link.ask(topics.ACTS, encode_decision(Decision(token))))
        decision = Decision(token, "flag", value=float(Flag.YELLOW), challenge=challenge)
        message = encode_decision(decision)
        for act, role in (("a driver", "seat-0"), ("a spectator", "spectator")):
            with _as(scene, role) as other:
                for name in ("act", "log"):
                    answer = other.ask(key(f"admin/{name}"), message)
                    scene.deny(f"admin/{name} as {act}", "answered" if answer else "")
        with _as(scene, "steward") as raw:
            forged = encode_decision(Decision("0" * 32, "flag", value=2.0, challenge=challenge))
            _deny(scene, "admin with a wrong token", raw.ask(key("admin/act"), forged))
            _allow(scene, "decide as steward", raw.ask(key("admin/act"), message))
            scene.allow("yellow flag as steward", _unless(_flag(scene) == Flag.YELLOW))
            _deny(scene, "the same decision again", raw.ask(key("admin/act"), message))
        steward.decide("flag", value=float(Flag.GREEN))
        steward.decide("penalty", seat=1, value=5.0)
        fined = int(session.world.racers[0, 1].penalty_us)
        scene.allow("penalty as steward", _unless(fined == 5_000_000))
        steward.decide("kick", seat=1)
        with _as(scene, "seat-1") as kicked:
            again = encode_join(Join("honest 1", "track", 1))
            _deny(scene, "join again after being sent away", kicked.ask(key("q/join/1"), again))
        steward.decide("open", seat=1)
        scene.allow("the steward's log", _unless(len(steward.log()) == 5))


def _flag(scene: Scene) -> int:
    return int(scene.served.server.session.world.races[0].flag)


def _unless(done: bool) -> str:
    return "" if done else "it had no effect"


def _as(scene: Scene, role: str) -> Intruder:
    return Intruder(scene.served.address, scene.served.keys(role))
