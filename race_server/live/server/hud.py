"""What acts on the karts of a race: what their drivers are told of it."""

import time
from collections.abc import Sequence

import numpy as np

from race_server.core.clock import TICKS_PER_SECOND
from race_server.core.driven import are_driven
from race_server.core.messages import Flag, PoseFault, Trust
from race_server.core.state import EFFECTS
from race_server.live.server.timing import ServerTiming
from race_server.net.wire.drive import EFFECT, HudFrame
from race_server.net.wire.spectate import Rows
from race_server.session.seats import Seat
from race_server.session.session import Session

_NO_EFFECTS = np.zeros(0, EFFECT)


def hud_of(session: Session, seat: Seat, orders_s: float = ServerTiming.orders_s) -> HudFrame:
    """Return what acts on a seat's kart now, and holds for `orders_s` [s]."""
    return huds_of(session, [seat], orders_s)[0]


def huds_of(session: Session, seats: Sequence[Seat], orders_s: float) -> list[HudFrame]:
    """Return what acts on the karts of seats now, and holds for `orders_s` [s]."""
    world, tick = session.world, session.tick
    bodies, racers, players = world.bodies[0], world.racers[0], world.players[0]
    caps, thrusts, grips, items, yellows = (
        rows[name].tolist()
        for rows, name in (
            *((bodies, name) for name in ("speed_cap", "thrust_scale", "grip_scale")),
            *((players, "held"), (racers, "yellow")),
        )
    )
    immune = (np.maximum(players["immune_until"], players["shield_until"]) - tick).tolist()
    driven = are_driven(world).tolist()
    act = (players["effects"]["source"] > 0).any(axis=1).tolist() if EFFECTS else []
    is_paused, flag = session.race_control.is_paused, int(world.races[0].flag)
    lights, now_us = lights_s(session), time.monotonic_ns() // 1000
    frames = []
    for seat in seats:
        kart = seat.number
        tracker = session.tracked_karts.trackers.get(kart)
        frames.append(
            HudFrame(
                epoch=session.epoch,
                tick=tick,
                # A kart that has finished or retired is to stop, from that tick on, unless it goes
                # to a slot. Where the clock stands all stop, under red: a kart that is told to
                # stop under another flag takes itself home.
                speed_cap=0.0 if is_paused or not driven[kart] else caps[kart],
                thrust_scale=thrusts[kart],
                grip_scale=grips[kart],
                item=items[kart],
                immune_s=max(immune[kart], 0) / TICKS_PER_SECOND,
                effects=_effects_on(session, kart) if act and act[kart] else _NO_EFFECTS,
                sequence=tracker.orders.sequence if tracker else 0,
                valid_s=orders_s,
                monotonic_us=now_us,
                lights_s=lights,
                flag=Flag.RED if is_paused else Flag(max(flag, int(yellows[kart]))),
                trust=tracker.trust if tracker else Trust.SIMULATED,
                fault=tracker.doubt if tracker else PoseFault.NONE,
                is_led=seat.is_led,
            )
        )
    return frames


def _effects_on(session: Session, kart: int) -> Rows:
    """Return the effects (EFFECT) that act on a kart."""
    slots = session.world.players["effects"][0, kart]
    acting = slots[slots["source"] > 0]
    effects = np.zeros(len(acting), EFFECT)
    effects["item"] = acting["source"]
    effects["remaining"] = np.maximum(acting["until_tick"] - session.tick, 0) / TICKS_PER_SECOND
    return effects


def lights_s(session: Session) -> float:
    """Return the time until the karts may drive [s], 0 once the race runs."""
    race = session.world.races[0]
    lights = max(int(race.start_tick), int(race.hold_until)) - session.tick
    return max(lights, 0) / TICKS_PER_SECOND
