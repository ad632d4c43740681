"""Real karts among simulated ones: they race with items, brake for people, stop when cut off.

Two plants race among simulated karts. A pedestrian steps in front of one while its driver is on the
throttle; the other loses its link later, on the throttle as well. At the end the race is simulated
again from its recording.
"""

import json
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from race_server.competition.launch import RaceSpec, TrackedSeat, free_address, run_race, spread
from race_server.core.messages import EventKind, Flag, PoseFault, Status, Trust
from race_server.core.vehicle_presets import vehicle_named
from race_server.core.vehicles import GRAVITY, Vehicle
from race_server.session.tracked.karts import Placements
from race_server.storage.recording.reader import read_recording
from race_server.terminal import Console
from race_server.tools.drills.replay import replay_of
from race_server.tools.drills.report import SmallDrill, document_of

SMALL = SmallDrill(
    "--track oval-report --vehicle tt02 --karts 4 --laps 4 --pedestrian 4 --cut-link 24",
    40,
    "missed_ticks",
)
# A kart without a link drives on for this time: 60 % of the time for which the last message holds,
# and the lag of its brakes. Then it brakes with this share of its nominal force: 60 %
# of the brakes of a kart that is heavier and has weaker ones.
WORD_S, SHARE = 0.35, 0.6 * 0.83
SESSION = "drill"
TRUSTED = Trust.TRUSTED.name.lower()
# If the machine had no time for a kart's program for 0.3 s, or missed this many ticks, poses may be
# late; nothing else excuses a pose fault.
MOST_MISSED = 18
LATE = (PoseFault.SILENT.name.lower(), PoseFault.STALE.name.lower())
# A kart that stops further from the pedestrian did not stop for it [lengths].
NEAR_LENGTHS = 2.0
# A kart that obeys is no faster than this above the cap, once it had time to brake [share].
OBEYS = 0.1


@dataclass(frozen=True)
class MixedRaceSetting:
    """One run of the drill."""

    track: str = "hangar-400"
    vehicle: str = "kart-30"
    karts: int = 8
    laps: int = 2
    seed: int = 1
    pedestrian_s: float = 12.0  # of racing
    cut_s: float = 110.0
    delay_ms: float = 0.0  # added to each message of a real kart
    driver: str = "pure_pursuit"  # of all karts: a slow one would hold up the others


def drill_mixed(setting: MixedRaceSetting, console: Console) -> dict[str, Any]:
    """Run the drill and return its document: `ok`, `why` not, and figures."""
    walker, cut = spread(2, setting.karts)
    with tempfile.TemporaryDirectory(prefix="race-drill-") as folder:
        reports = {seat: Path(folder, f"{seat}.json") for seat in (walker, cut)}
        options = {
            walker: ("--pedestrian", str(setting.pedestrian_s)),
            cut: ("--cut-link", str(setting.cut_s)),
        }
        real = tuple(
            TrackedSeat(seat, (*more, "--report", str(reports[seat]), *_link(setting)))
            for seat, more in options.items()
        )
        document = run_race(_plan(setting, free_address(), real, folder), console)
        again = _drive_again(Path(folder), document["digest"])
        found = {
            seat: json.loads(path.read_text()) if path.exists() else {}
            for seat, path in reports.items()
        }
    figures: dict[str, Any] = {
        "pedestrian": {"seat": walker, **_figures_of(document, walker, found[walker])},
        "cut": {"seat": cut, **_figures_of(document, cut, found[cut])},
    }
    vehicle = vehicle_named(setting.vehicle)
    is_busy = document["missed_ticks"] > MOST_MISSED
    is_busy |= any(part["kart"].get("pauses") for part in figures.values())
    why = [*judge_both(figures, is_busy=is_busy), *_judge_walker(figures["pedestrian"], vehicle)]
    why += [*_judge_cut(figures["cut"], vehicle), *again["why"]]
    return document_of(
        why,
        figures=figures,
        digests_equal=again["digests"],
        placements=again["placements"],
        missed_ticks=document["missed_ticks"],
        machine_busy=is_busy,
    )


def _drive_again(folder: Path, digest: str) -> dict[str, Any]:
    """Simulate a race again from its recording and compare the two."""
    (path,) = folder.glob(f"{SESSION}-*.mcap")
    recording = read_recording(path)
    replay = replay_of(recording, digest)
    why = [f"its recording {replay.fault}"] if replay.fault else []
    placements = sum(isinstance(entry, Placements) for entry in recording.entries)
    return {"why": why, "digests": replay.digests, "placements": placements}


def _link(setting: MixedRaceSetting) -> tuple[str, ...]:
    return ("--delay-ms", str(setting.delay_ms)) if setting.delay_ms else ()


def _plan(
    setting: MixedRaceSetting, address: str, real: tuple[TrackedSeat, ...], folder: str
) -> RaceSpec:
    serve = ["--track", setting.track, "--vehicle", setting.vehicle, "--results", "none"]
    serve += ["--record", folder, "--fresh"]
    serve += ["--karts", str(setting.karts), "--laps", str(setting.laps)]
    serve += ["--seed", str(setting.seed), "--items", "on"]
    drivers = (setting.driver,) * setting.karts
    return RaceSpec(tuple(serve), drivers, address, SESSION, real=real)


def _figures_of(document: dict[str, Any], seat: int, report: dict[str, Any]) -> dict[str, Any]:
    """Return the figures of one kart, from the server and from the kart itself."""
    row = next(kart for kart in document["karts"] if kart["seat"] == seat)
    link: dict[str, Any] = next((link for link in document["tracked"] if link["seat"] == seat), {})
    events = [event for event in document["events"] if event["kart"] == seat]
    kinds = [event["kind"] for event in events]
    return {
        "status": row["status"],
        "laps": row["laps"],
        "items_picked_up": kinds.count(EventKind.PICK_UP.name.lower()),
        "items_used": row["items_used"],
        "hits": kinds.count(EventKind.HIT.name.lower()),
        "trust": [
            Trust(event["other"]).name.lower()
            for event in events
            if event["kind"] == EventKind.POSE.name.lower()
        ],
        "doubts": [
            PoseFault(event["value"]).name.lower()
            for event in events
            if event["kind"] == EventKind.POSE.name.lower() and event["other"] == Trust.DOUBTFUL
        ],
        "yellow_flags": sum(
            event["kind"] == EventKind.FLAG.name.lower() and event["other"] == Flag.YELLOW
            for event in events
        ),
        "link": link,
        "kart": report,
    }


def judge_both(figures: dict[str, Any], *, is_busy: bool) -> list[str]:
    """Return what is wrong with the karts of a race. is_busy: the machine was too slow at times."""
    why = []
    for name, part in figures.items():
        seat, kart = part["seat"], part["kart"]
        # The last fault is that of the cut link.
        doubts = part["doubts"][:-1] if name == "cut" else part["doubts"]
        if told := [doubt for doubt in doubts if not (is_busy and doubt in LATE)]:
            why.append(f"the kart on seat {seat} lost trust without a reason: {', '.join(told)}")
        if part["laps"] < 1:
            why.append(f"the kart on seat {seat} finished no lap")
        if not kart:
            why.append(f"the kart on seat {seat} left no report")
        elif kart["worst_excess_share"] > OBEYS:
            share = kart["worst_excess_share"]
            why.append(f"the kart on seat {seat} went {share:.0%} over its speed cap")
    if not any(part["items_used"] for part in figures.values()):
        why.append("no real kart used an item")
    if not any(part["kart"].get("slowdowns") for part in figures.values()):
        why.append("no effect or flag slowed a real kart")
    return why


def _judge_walker(part: dict[str, Any], vehicle: Vehicle) -> list[str]:
    met = part["kart"].get("pedestrian") or {}
    why = []
    if part["status"] != Status.FINISHED.name.lower() or part["link"].get("trust") != TRUSTED:
        link = part["link"].get("trust", "unknown")
        why.append(f"the kart that met the pedestrian ended {part['status']} and {link}")
    if "gap_left_m" not in met:
        return [*why, "the kart did not come to a stop before the pedestrian"]
    if min(met["gap_left_m"], met["least_gap_m"]) <= 0.0:
        why.append(f"the pedestrian was hit: {met['least_gap_m']:.2f} m left")
    if met["gap_left_m"] > NEAR_LENGTHS * vehicle.length:
        why.append(f"the kart stopped {met['gap_left_m']:.1f} m from the pedestrian, not for it")
    if met["driver_throttle"] < 1.0:
        why.append("the driver's throttle was not full")
    return why


def _judge_cut(part: dict[str, Any], vehicle: Vehicle) -> list[str]:
    cut = part["kart"].get("cut") or {}
    if "stopped_within_m" not in cut:
        return ["the kart whose link was cut did not stop"]
    why = []
    cut["allowed_m"] = most = way_to_stop(vehicle, cut["speed"])
    if cut["stopped_within_m"] > most:
        why.append(
            f"without a link it needed {cut['stopped_within_m']:.1f} m; {most:.1f} m are allowed"
        )
    if part["yellow_flags"] == 0:
        why.append("the cut link raised no yellow flag")
    return why


def way_to_stop(vehicle: Vehicle, speed: float) -> float:
    """Return the stopping distance [m] of a kart that loses its link at full throttle."""
    then = max(min(speed + WORD_S * vehicle.motor_force / vehicle.mass, vehicle.top_speed), speed)
    braking = min(SHARE * vehicle.brake_force / vehicle.mass, vehicle.grip * GRAVITY)
    return 0.5 * WORD_S * (speed + then) + then * then / (2.0 * braking)
