"""The three invariants, and the rules as they act in a whole world."""

import ast
import math
import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from race_server import core
from race_server.core.messages import EventKind, Flag, Retirement, Status
from race_server.core.rules.items import items
from race_server.core.state import HASHED, World, digest, field_of, part_of
from race_server.core.step import advance, show_flag, withdraw
from race_server.scenario.race import Rules, Scenario, make_world
from support.courses import SMALL_RING

NUMBERS = {item.name: number for number, item in enumerate(items(), start=1)}
QUICK = Rules(countdown_s=0.0, laps=3)


def scenario(karts: int = 1, rules: Rules = QUICK, seed: int = 7) -> Scenario:
    return Scenario(SMALL_RING, karts=karts, rules=rules, seed=seed)


def follow(world: World, *, throttle: float = 0.5, button: int = 0) -> np.ndarray:
    """Return controls that keep every kart on the ring."""
    racers = world.racers
    controls = np.zeros((*racers.shape, 4))
    heading_error = racers["heading_error"] if throttle >= 0.0 else -racers["heading_error"]
    wanted = 0.044 - 0.5 * racers["lateral_offset"] - 1.0 * heading_error
    controls[..., 0] = np.clip(wanted / 0.314, -1.0, 1.0)
    controls[..., 1] = throttle
    controls[..., 3] = button
    return controls


def run(world: World, seconds: float, **how: float) -> list[tuple[EventKind, int, int, int]]:
    events = []
    for _ in range(round(seconds * 20)):
        advance(world, follow(world, **how), 3)
        rows = world.events[0][: world.event_counts[0]]
        events += [
            (EventKind(e.kind), int(e.kart), int(e.other), int(e.value)) for e in rows.copy()
        ]
        world.event_counts[:] = 0
    return events


def kinds(events: list[tuple[EventKind, int, int, int]]) -> list[EventKind]:
    return [event[0] for event in events]


def wild(rng: np.random.Generator, shape: tuple[int, int]) -> np.ndarray:
    controls = rng.uniform(-1.0, 1.0, (*shape, 4))
    controls[..., 1] = rng.uniform(-0.2, 1.0, shape)
    controls[..., 2] = rng.uniform(0.0, 0.3, shape)
    controls[..., 3] = rng.integers(0, 4, shape)
    return controls


def wild_digest(count: int, index: int, *, threads: int = 1) -> str:
    """Return the digest of world `index` of a batch after 300 ticks of wild inputs drawn for it."""
    seeds = range(count) if count > 1 else (index,)
    world = make_world(scenario(karts=6), seeds=seeds)
    inputs = [np.random.default_rng(seed) for seed in seeds]
    cuts = np.linspace(0, count, threads + 1).astype(int)
    with ThreadPoolExecutor(threads) as pool:
        for _ in range(100):
            controls = np.stack([wild(rng, (6,)) for rng in inputs])
            jobs = [
                pool.submit(advance, part_of(world, a, b), controls[a:b], 3)
                for a, b in pairwise(cuts)
            ]
            for job in jobs:
                job.result()
    return digest(world, index if count > 1 else 0)


def test_world_5_of_a_batch_of_8_evolves_like_the_same_world_alone() -> None:
    assert wild_digest(8, 5) == wild_digest(1, 5)


def test_the_number_of_threads_makes_no_difference() -> None:
    assert wild_digest(8, 5, threads=2) == wild_digest(8, 5)


def test_another_process_gives_the_same_digest() -> None:
    code = "import test_world; print(test_world.wild_digest(1, 5))"
    here = Path(__file__).parent
    paths = {"PYTHONPATH": os.pathsep.join((str(here), str(here.parent)))}
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, env=os.environ | paths, capture_output=True, check=True)
    assert done.stdout.decode().strip() == wild_digest(1, 5)


def test_another_seed_gives_another_digest() -> None:
    assert wild_digest(1, 5) != wild_digest(1, 6)


def test_ticks_in_one_call_or_in_many_make_no_difference() -> None:
    one, many = make_world(scenario(karts=3)), make_world(scenario(karts=3))
    controls = follow(one)
    advance(one, controls, 90)
    for _ in range(90):
        advance(many, controls, 1)
    assert digest(one) == digest(many)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, 1e300])
def test_no_input_of_one_kart_changes_another(bad: float) -> None:
    rules = replace(QUICK, kart_contact="ghost", items=False)
    alone, attacked = make_world(scenario(2, rules)), make_world(scenario(2, rules))
    for _ in range(100):
        controls = follow(alone)
        controls[0, 0] = 0.0
        advance(alone, controls, 3)
        controls = follow(attacked)
        controls[0, 0] = bad
        advance(attacked, controls, 3)
    for name in set(HASHED.split()) - {"rank"}:  # it depends on the other kart as well
        mine, theirs = field_of(alone, name)[0, 1], field_of(attacked, name)[0, 1]
        assert mine.tobytes() == theirs.tobytes(), name
    # What is not a number counts as zero; anything else did act on the kart that was given it.
    assert (digest(alone) == digest(attacked)) == math.isnan(bad)


def test_no_kart_ever_leaves_the_borders() -> None:
    world = make_world(scenario(karts=6), seeds=range(8))
    rng = np.random.default_rng(1)
    for _ in range(300):
        advance(world, wild(rng, (8, 6)), 3)
    assert np.abs(world.racers["lateral_offset"]).max() < 0.7


def test_three_laps_finish_the_race() -> None:
    world = make_world(scenario())
    events = run(world, 60.0)
    assert kinds(events).count(EventKind.LAP) == 3
    assert EventKind.FINISH in kinds(events)
    assert world.bodies["status"][0, 0] == Status.FINISHED


def test_lap_times_add_up_to_the_race_time() -> None:
    world = make_world(scenario())
    events = run(world, 60.0)
    laps = [value for kind, _, _, value in events if kind is EventKind.LAP]
    assert world.racers["finish_us"][0, 0] == sum(laps)


def test_three_sectors_add_up_to_the_lap() -> None:
    world = make_world(scenario())
    events = run(world, 60.0)
    sectors = [value for kind, _, _, value in events if kind is EventKind.SECTOR]
    laps = [value for kind, _, _, value in events if kind is EventKind.LAP]
    count = len(sectors) // 3
    assert sum(sectors[:count]) == laps[0]


def test_who_moves_before_the_lights_gets_a_penalty() -> None:
    world = make_world(scenario(rules=replace(QUICK, countdown_s=3.0)))
    events = run(world, 2.0)
    assert EventKind.FALSE_START in kinds(events)
    assert world.racers["penalty_us"][0, 0] == 5_000_000


def test_who_waits_for_the_lights_gets_none() -> None:
    world = make_world(scenario(rules=replace(QUICK, countdown_s=2.0)))
    assert kinds(run(world, 1.9, throttle=0.0)) == []
    assert EventKind.GREEN in kinds(run(world, 1.0))


def test_a_kart_that_drives_backwards_is_told_so() -> None:
    world = make_world(scenario())
    run(world, 3.0, throttle=0.0)
    assert EventKind.WRONG_WAY in kinds(run(world, 6.0, throttle=-1.0))
    assert world.racers["laps"][0, 0] == 0


def test_driving_over_the_line_backwards_and_forwards_again_gives_no_lap() -> None:
    world = make_world(scenario())
    run(world, 2.5)
    run(world, 6.0, throttle=-1.0)
    run(world, 3.0)
    assert world.racers["laps"][0, 0] == 0


def put(world: World, kart: int, degrees: float) -> None:
    """Carry a kart to another place on the ring, without telling the rules."""
    angle = np.radians(degrees)
    row = world.bodies[0, kart]
    row.x, row.y, row.heading = 6 * np.cos(angle), 6 * np.sin(angle), angle + np.pi / 2


def test_a_kart_carried_past_gates_gets_a_penalty_and_no_lap() -> None:
    world = make_world(scenario())
    run(world, 4.0)
    assert world.racers["started"][0, 0] == 1
    put(world, 0, 170.0)
    events = run(world, 4.0)
    assert EventKind.SHORT_CUT in kinds(events)
    assert world.racers["laps"][0, 0] == 0


def test_a_stuck_kart_may_accept_a_rescue_for_a_penalty() -> None:
    world = make_world(scenario())
    run(world, 2.0)
    world.racers[0, 0].lateral_offset = 0.0
    assert EventKind.STUCK in kinds(run(world, 8.0, throttle=0.0))
    events = run(world, 1.0, throttle=0.0, button=2)
    assert EventKind.RESCUED in kinds(events)
    assert world.racers["penalty_us"][0, 0] == 5_000_000
    assert world.racers["lateral_offset"][0, 0] == pytest.approx(0.0, abs=0.01)
    assert world.racers["wrong_way"][0, 0] == 0


def test_yellow_caps_the_speed_and_green_frees_it() -> None:
    world = make_world(scenario(rules=replace(QUICK, laps=0)))
    show_flag(world, 0, int(Flag.YELLOW))
    run(world, 10.0, throttle=1.0)
    assert world.bodies["speed"][0, 0] <= 4.0
    show_flag(world, 0, int(Flag.GREEN))
    run(world, 5.0, throttle=1.0)
    assert world.bodies["speed_cap"][0, 0] == pytest.approx(10.0)


def test_red_stops_all_and_green_restarts_after_three_seconds() -> None:
    world = make_world(scenario(karts=2, rules=replace(QUICK, laps=0, items=False)))
    run(world, 5.0)
    show_flag(world, 0, int(Flag.RED))
    run(world, 5.0, throttle=1.0)
    assert np.abs(world.bodies["speed"][0]).max() < 0.01
    show_flag(world, 0, int(Flag.GREEN))
    run(world, 2.9, throttle=1.0)
    assert np.abs(world.bodies["speed"][0]).max() < 0.01
    run(world, 2.0, throttle=1.0)
    assert world.bodies["speed"][0].min() > 1.0


def test_retire_policy_takes_a_kart_out_at_the_first_wall() -> None:
    world = make_world(scenario(rules=replace(QUICK, wall_contact="retire")))
    advance(world, np.array([[[-1.0, 1.0, 0.0, 0.0]]]), 300)
    assert world.bodies["status"][0, 0] == Status.RETIRED
    assert world.racers["retired_for"][0, 0] == Retirement.CRASH


def test_a_contact_in_the_first_ticks_counts_and_leaning_on_is_the_same_one() -> None:
    world = make_world(scenario(karts=2))
    first, second = world.bodies[0]
    second.x = first.x + 0.6 * np.cos(first.heading)
    second.y = first.y + 0.6 * np.sin(first.heading)
    second.heading = first.heading + np.pi
    first.speed = second.speed = 2.0
    advance(world, np.zeros((1, 2, 4)), 25)
    assert list(world.racers["contacts"][0]) == [1, 1]


def test_ghosts_drive_through_each_other() -> None:
    world = make_world(scenario(karts=2, rules=replace(QUICK, kart_contact="ghost")))
    world.bodies["x"][0, 1], world.bodies["y"][0, 1] = world.bodies["x"][0, 0], 0.0
    run(world, 2.0)
    assert world.racers["contacts"].sum() == 0


def test_who_withdraws_is_ranked_behind_who_races() -> None:
    world = make_world(scenario(karts=2))
    run(world, 3.0)
    withdraw(world, 0, 0)
    run(world, 30.0)
    assert list(world.racers["rank"][0]) == [2, 1]


def item_world(name: str) -> World:
    """Return a world of two karts on their way, kart 0 behind and holding an item."""
    rules = replace(QUICK, laps=0)
    world = make_world(replace(scenario(karts=2, rules=rules), grid_order=(1, 0)))
    run(world, 2.0)
    world.players[0, 0].held = NUMBERS[name]
    return world


def test_boost_lifts_the_cap_by_a_quarter_for_two_seconds() -> None:
    world = item_world("boost")
    run(world, 0.05, button=1)
    assert world.bodies["speed_cap"][0, 0] == pytest.approx(12.5)
    run(world, 2.05)
    assert world.bodies["speed_cap"][0, 0] == pytest.approx(10.0)


def test_pulse_slows_the_kart_ahead() -> None:
    world = item_world("pulse")
    assert (EventKind.HIT, 1, 0, NUMBERS["pulse"]) in run(world, 0.05, button=1)
    run(world, 0.05)
    assert world.bodies["speed_cap"][0, 1] == pytest.approx(5.0)


def test_the_leader_keeps_a_pulse_that_would_hit_nobody() -> None:
    world = item_world("pulse")
    world.players[0, 0].held, world.players[0, 1].held = 0, NUMBERS["pulse"]
    run(world, 0.05, button=1)
    assert world.players["held"][0, 1] == NUMBERS["pulse"]


def test_a_shield_takes_one_hit() -> None:
    world = item_world("pulse")
    world.players[0, 1].shield_until = world.races[0].tick + 600
    assert EventKind.BLOCKED_HIT in kinds(run(world, 0.05, button=1))
    assert world.players["hits"][0, 1] == 0
    world.players[0, 0].held = NUMBERS["pulse"]
    run(world, 0.05)
    assert EventKind.HIT in kinds(run(world, 0.05, button=1))


def test_immunity_follows_a_hit() -> None:
    world = item_world("pulse")
    run(world, 0.05, button=1)
    run(world, 1.6)
    world.players[0, 0].held = NUMBERS["pulse"]
    assert EventKind.BLOCKED_HIT in kinds(run(world, 0.05, button=1))


def test_oil_spares_its_owner_at_first_and_hits_who_drives_into_it() -> None:
    world = item_world("oil")
    assert EventKind.HIT not in kinds(run(world, 0.05, button=1))
    hazard = world.hazards[0, 0]
    assert hazard.owner == 0
    victim = world.bodies[0, 1]
    victim.x, victim.y = hazard.x, hazard.y
    events = run(world, 0.05)
    assert (EventKind.HIT, 1, 0, NUMBERS["oil"]) in events
    assert world.bodies["grip_scale"][0, 1] == pytest.approx(0.7)


def test_a_box_that_was_taken_comes_back_after_five_seconds() -> None:
    world = make_world(scenario(rules=replace(QUICK, laps=0)))
    put(world, 0, 90.0)
    assert EventKind.PICK_UP in kinds(run(world, 0.1, throttle=0.0))
    assert world.boxes["ready_tick"][0].max() == pytest.approx(300, abs=6)


def test_two_karts_at_the_same_place_are_ranked_by_the_grid() -> None:
    world = make_world(scenario(karts=3))
    advance(world, np.zeros((1, 3, 4)), 1)
    assert list(world.racers["rank"][0]) == [1, 2, 3]


def names_from_step(path: Path) -> set[str]:
    """Return what a file imports from `race_server.core.step`."""
    found = [node for node in ast.walk(ast.parse(path.read_text())) if type(node) is ast.ImportFrom]
    modules = [node for node in found if node.module == "race_server.core.step"]
    return {name.name for node in modules for name in node.names}


def test_time_passes_through_one_function_only() -> None:
    package = Path(core.__file__).parents[1]
    taken = set().union(*(names_from_step(path) for path in package.rglob("*.py")))
    assert {"advance", "advance_world"} <= taken  # by the live server, by training
    assert "step" not in taken
