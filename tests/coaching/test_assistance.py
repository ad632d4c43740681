"""Assistance: the same situations, and the same answers, as on the page."""

import json
import random
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from race_server.coaching.assistance import Guide, Level, Pedals, Situation, assist
from race_server.core.messages import Flag, KartFlag, Phase, Status
from race_server.scenario.track.line import ReferenceLine

# Written by `python tests/coaching/test_assistance.py`; the page's tests read it too.
SHARED = Path(__file__).parents[1] / "shared" / "assistance.json"
COUNT = 10_000
SAMPLES = 120


def line_of(columns: dict[str, Any]) -> ReferenceLine:
    x, y, speed = (np.array(columns[name]) for name in ("x", "y", "speed"))
    nothing, order = np.zeros(len(x)), np.arange(len(x))
    return ReferenceLine(columns["spacing"], x, y, nothing, nothing, speed, nothing, nothing, order)


def answer(guide: Guide, row: list[Any]) -> list[Any]:
    """Return throttle, brake and what is done for one situation."""
    level, throttle, brake, x, y, heading, speed, cap, phase, lights, status, flags, flag = row
    situation = Situation(
        *(x, y, heading, speed, cap, Phase(phase), lights),
        *(Status(status), KartFlag(flags), Flag(flag)),
    )
    pedals = assist(Level(level), Pedals(throttle, brake), situation, guide)
    return [pedals.throttle, pedals.brake, pedals.does]


def drawn_line() -> dict[str, Any]:
    """Return an ellipse with a speed at each place."""
    turns = np.linspace(0.0, 2.0 * np.pi, SAMPLES, endpoint=False)
    return {
        "spacing": 0.8,
        "x": np.round(20.0 * np.cos(turns), 4).tolist(),
        "y": np.round(10.0 * np.sin(turns), 4).tolist(),
        "speed": [round(8.0 + 5.0 * float(np.cos(2.0 * turn)), 4) for turn in turns],
    }


def drawn_row(chance: random.Random, line: dict[str, Any]) -> list[Any]:
    """Return a situation: mostly on the line, in a race that goes on."""
    index = chance.randrange(SAMPLES)
    following = (index + 1) % SAMPLES
    x, y = line["x"][index], line["y"][index]
    way = float(np.arctan2(line["y"][following] - y, line["x"][following] - x))
    is_common = chance.random() < 0.8
    return [
        chance.choice([0, 1, 2, 2, 2, 3, 3, 3]),
        round(chance.choice([0.0, 0.03, 1.0, chance.uniform(-1.0, 1.0)]), 3),
        round(chance.choice([0.0, 0.0, 0.04, chance.random()]), 3),
        round(x + chance.gauss(0.0, 0.8), 3),
        round(y + chance.gauss(0.0, 0.8), 3),
        round(way + (chance.gauss(0.0, 0.2) if is_common else chance.uniform(-3.1, 3.1)), 3),
        round(chance.uniform(-1.0, 14.0), 3),
        chance.choice([40.0, 40.0, 5.0]),
        int(Phase.RUNNING if is_common else chance.choice(list(Phase))),
        0 if is_common else chance.randrange(3),
        int(Status.RACING if is_common else chance.choice(list(Status))),
        0 if is_common else chance.choice([0, 1, 2, 4, 8]),
        0 if is_common else chance.randrange(3),
    ]


def shared() -> dict[str, Any]:
    content: dict[str, Any] = json.loads(SHARED.read_text())
    return content


def test_ten_thousand_situations_have_the_answers_that_the_page_gives() -> None:
    content = shared()
    guide = Guide(line_of(content["line"]))
    assert len(content["rows"]) == COUNT
    for row, wanted in zip(content["rows"], content["answers"], strict=True):
        assert answer(guide, row) == wanted, row


def test_the_situations_reach_every_kind_of_answer() -> None:
    content = shared()
    does = [wanted[2] for wanted in content["answers"]]
    assert min(does.count(word) for word in ("", "brake", "accelerate")) > 500
    changed = sum(
        row[1:3] != wanted[:2]
        for row, wanted in zip(content["rows"], content["answers"], strict=True)
    )
    assert 2000 < changed < 9000


@pytest.mark.parametrize("level", [Level.NONE, Level.LINE])
def test_with_the_line_alone_the_driver_does_everything(level: Level) -> None:
    own = Pedals(1.0, 0.0)
    situation = Situation(
        *(20.0, 0.0, 1.57, 30.0, 40.0, Phase.RUNNING, 0),
        *(Status.RACING, KartFlag(0), Flag.GREEN),
    )
    guide = Guide(line_of(shared()["line"]))
    assert assist(level, own, situation, guide) is own
    assert assist(Level.BRAKES, own, situation, guide) == Pedals(0.0, 1.0, "brake")
    assert assist(Level.BRAKES, own, situation, None) is own


if __name__ == "__main__":
    CHANCE = random.Random(42)
    LINE = drawn_line()
    ROWS = [drawn_row(CHANCE, LINE) for _ in range(COUNT)]
    GUIDE = Guide(line_of(LINE))
    TEXT = {"line": LINE, "rows": ROWS, "answers": [answer(GUIDE, row) for row in ROWS]}
    SHARED.parent.mkdir(exist_ok=True)
    SHARED.write_text(json.dumps(TEXT, separators=(",", ":")) + "\n")
