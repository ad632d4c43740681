"""Forbidden messages: on keys of others, too large, too frequent, and repeated."""

import time

from race_server.core.messages import Control
from race_server.credentials import badge_of
from race_server.errors import Reason
from race_server.net.wire import topics
from race_server.net.wire.drive import ControlFrame, encode_control
from race_server.tools.drills.intruder import SETTLE_S, Ears, Intruder, key
from race_server.tools.drills.scene import Scene

MEGABYTES = 3_000_000
# Controls a second of a client that sends too fast, and for how long.
FAST_HZ, FAST_S = 1000, 1.0


def try_legal(scene: Scene) -> None:
    """Check that an honest driver drives and observes, and an honest spectator watches."""
    session = scene.served.server.session
    driver = scene.drivers[0]
    scene.allow("take a seat and be ready", "" if session.seats[0].is_ready else "not ready")
    frame = driver.receive(5.0)
    scene.allow("hear own observation", "" if frame else "nothing came")
    before = session.seats[0].sequence
    if frame:
        for number in range(1, 21):
            driver.answer(frame.epoch, before + number, frame.tick, Control(throttle=0.1))
            time.sleep(0.05)
    done = session.seats[0].sequence - before
    scene.allow("control at 20 Hz", "" if done == 20 else f"{done} of 20 counted")
    scene.allow("watch as spectator", "" if scene.told.count else "nothing came")
    rules = scene.spectator.ask(topics.RULES)
    scene.allow("ask for the rules as spectator", "" if rules else "no answer")


def try_puts(scene: Scene) -> None:
    """Try puts and deletes on keys of others."""
    with _as(scene, "seat-0") as seat, _as(scene, "spectator") as spectator:
        tries = {
            "put on another seat's key": seat.put("in/1"),
            "wildcard put on all seats": seat.put("in/*"),
            "wildcard put on everything": seat.put("**"),
            "fake snapshot": seat.put("out/snapshot"),
            "fake event": seat.put("out/events"),
            "fake observation of another seat": seat.put("obs/1"),
            "put on an unknown key": seat.put("out/other"),
            "control from a spectator": spectator.put("in/0"),
            "fake snapshot from a spectator": spectator.put("out/snapshot"),
        }
        own = seat.put("in/0")
        time.sleep(SETTLE_S)
        # Only if this one arrives does it mean something that the others do not.
        scene.allow("put on own key", "" if scene.reached(own) else "it did not arrive")
        for act, payload in tries.items():
            scene.deny(act, scene.reached(payload))
        counts = scene.arrived.count
        for act, name in {
            "delete of own key": "in/0",
            "delete of another seat's key": "in/1",
            "delete of the snapshot": "out/snapshot",
        }.items():
            seat.session.delete(key(name))
            time.sleep(SETTLE_S)
            scene.deny(act, "reached the server" if scene.arrived.count > counts else "")


def try_listening(scene: Scene) -> None:
    """Try subscriptions to messages for others."""

    def nothing() -> None:
        """Do nothing: the race itself publishes all the time."""

    def drive_honestly() -> None:
        scene.drivers[1].send(b"a control")

    with _as(scene, "seat-0") as seat, _as(scene, "spectator") as spectator:
        heard = seat.overhears(key("obs/0"), nothing)
        scene.allow("listen to own observation", "" if heard else "nothing came")
        for act, who, name in (
            ("listen to another seat's observation", seat, key("obs/1")),
            ("listen to everything", seat, "**"),
            ("listen to all observations as spectator", spectator, key("obs/*")),
        ):
            scene.deny(act, "heard" if who.overhears(name, nothing) else "")
        heard = spectator.overhears(key("in/*"), drive_honestly)
        scene.deny("listen to controls", "heard" if heard else "")


def try_presence(scene: Scene) -> None:
    """Try liveliness tokens of others, and queries for present clients."""
    server = scene.served.server
    with _as(scene, "seat-0") as seat, _as(scene, "spectator") as spectator:
        liveliness = seat.session.liveliness()
        tokens = [
            liveliness.declare_token(key("alive/1/00")),
            spectator.session.liveliness().declare_token(key("alive/2/00")),
        ]
        time.sleep(SETTLE_S)
        for number, act in ((1, "liveliness token of another seat"), (2, "token of a spectator")):
            scene.deny(act, "seen by the server" if server.link.holders.is_doubled(number) else "")
        for token in tokens:
            token.undeclare()
        found = list(liveliness.get(key("alive/**"), timeout=SETTLE_S))
        scene.deny("ask for present clients", f"{len(found)} answers" if found else "")
        ears = Ears()
        liveliness.declare_subscriber(key("alive/**"), lambda sample: ears.hear(b""), history=True)
        time.sleep(SETTLE_S)
        scene.deny("listen to who comes and goes", "heard" if ears.count else "")


def try_limits(scene: Scene) -> None:
    """Try messages that are too large, and too many."""
    badge = badge_of(scene.drivers[2].welcome.secret).encode()
    own = key("in/2")
    with _as(scene, "seat-2") as seat:
        for act, size in (("control of 1 kB", 1024), ("control of 3 MB", MEGABYTES)):
            seat.session.put(own, bytes(size), attachment=badge)
            time.sleep(SETTLE_S)
            arrived = any(len(payload) == size for payload in scene.arrived.heard)
            scene.deny(act, "reached the server" if arrived else "")
        answer = seat.ask(key("q/join/2"), bytes(4096))
        scene.deny("request of 4 kB", "answered" if answer else "")
    # Shared memory, if the receiver takes it, bypasses the size limit of messages.
    shared = {"transport/shared_memory/enabled": True}
    keys = scene.served.keys("seat-2")
    with Intruder(scene.served.address, keys, **shared) as seat:
        seat.session.put(own, bytes(MEGABYTES + 1), attachment=badge)
        time.sleep(SETTLE_S)
        arrived = any(len(payload) > MEGABYTES for payload in scene.arrived.heard)
        scene.deny("control of 3 MB in shared memory", "reached the server" if arrived else "")
    with _as(scene, "seat-2") as seat:
        before = scene.served.server.link.dropped[Reason.FOREIGN, 2]
        _send_fast(seat, own, badge)
        passed = scene.served.server.link.dropped[Reason.FOREIGN, 2] - before
        most = round(1.1 * topics.CONTROL_HZ * FAST_S)
        seen = "" if 0 < passed <= most else f"{passed} of {FAST_HZ * FAST_S:g} came through"
        scene.deny(f"{FAST_HZ} controls a second", seen)


def _send_fast(seat: Intruder, own: str, badge: bytes) -> None:
    start = time.perf_counter()
    for number in range(round(FAST_HZ * FAST_S)):
        seat.session.put(own, b"no control at all", attachment=badge)
        time.sleep(max(start + (number + 1) / FAST_HZ - time.perf_counter(), 0.0))
    time.sleep(SETTLE_S)


def try_replay(scene: Scene) -> None:
    """Try a control that is sent again, and one of an earlier epoch."""
    session, driver = scene.served.server.session, scene.drivers[0]
    seat = session.seats[0]
    sequence = seat.sequence + 1
    control = encode_control(ControlFrame(session.epoch, sequence, 0, Control(throttle=0.3)))
    driver.send(control)
    time.sleep(SETTLE_S)
    scene.allow("a new control", "" if seat.sequence == sequence else "did not count")
    for act, data in (
        ("the same control again", control),
        ("an older control", _control(session.epoch, sequence - 1)),
        ("a control of another epoch", _control(session.epoch - 1, sequence + 1)),
    ):
        taken = seat.control_tick
        driver.send(data)
        time.sleep(SETTLE_S)
        scene.deny(act, "it counted" if seat.control_tick != taken else "")


def _control(epoch: int, sequence: int) -> bytes:
    return encode_control(ControlFrame(epoch, sequence, 0, Control(throttle=1.0)))


def _as(scene: Scene, role: str) -> Intruder:
    return Intruder(scene.served.address, scene.served.keys(role))
