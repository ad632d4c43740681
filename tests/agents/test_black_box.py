"""Black boxes that another program wrote."""

import json
from pathlib import Path
from typing import Any

import pytest
from mcap.writer import CompressionType, Writer
from typer.testing import CliRunner

from race_agents.onboard.black_box import TOPIC, read_black_box
from race_server.cli.main import app
from race_server.errors import RecordingError

ALERT = {"stage": "none", "kind": "nothing", "distance": None}
TURN = {"time_s": 1.0, "command": [0.0, 0.5, 0.0], "cause": [], "alert": ALERT}


def written(path: Path, *turns: Any, packed: CompressionType = CompressionType.ZSTD) -> Path:
    """Return a file of turns; one given as bytes is written as it is."""
    with path.open("wb") as file:
        writer = Writer(file, compression=packed)
        writer.start("another", "program")
        schema = writer.register_schema("kart.Turn", "jsonschema", b"{}")
        channel = writer.register_channel(TOPIC, "json", schema)
        for at, turn in enumerate(turns):
            data = turn if isinstance(turn, bytes) else json.dumps(turn).encode()
            writer.add_message(channel, log_time=at, publish_time=at, data=data)
        writer.finish()
    return path


def without(name: str) -> dict[str, Any]:
    return {key: value for key, value in TURN.items() if key != name}


@pytest.mark.parametrize("name", list(TURN))
def test_a_turn_without_what_is_shown_is_named_with_its_file(name: str, tmp_path: Path) -> None:
    path = written(tmp_path / "kart.mcap", TURN, without(name))
    with pytest.raises(
        RecordingError, match=rf"kart\.mcap .* message 2 of kart/turn has no {name}"
    ):
        list(read_black_box(path))
    told = CliRunner().invoke(app, ["black-box", str(path)])
    assert isinstance(told.exception, RecordingError)


@pytest.mark.parametrize(
    ("turn", "fault"),
    [
        ([1, 2], "holds no named values"),
        (TURN | {"time_s": "1"}, "unknown kind of time_s"),
        (TURN | {"time_s": 10**400}, "unknown kind of time_s"),
        (TURN | {"command": [0.0, 0.5]}, "unknown kind of command"),
        (TURN | {"command": [0.0, 0.5, "full"]}, "unknown kind of command"),
        (TURN | {"cause": None}, "unknown kind of cause"),
        (TURN | {"cause": [{}]}, "unknown kind of cause"),
        (TURN | {"alert": "none"}, "unknown kind of alert"),
        (TURN | {"alert": ALERT | {"stage": 1}}, "unknown kind of alert"),
        (TURN | {"alert": {"stage": "none", "kind": "nothing"}}, "unknown kind of alert"),
        (TURN | {"state": [0.0, 0.0, 0.0]}, "unknown kind of state"),
        (TURN | {"deviation": []}, "unknown kind of deviation"),
    ],
)
def test_a_turn_of_another_form_is_told_in_one_sentence(
    turn: Any, fault: str, tmp_path: Path
) -> None:
    with pytest.raises(RecordingError, match=f"message 1 of kart/turn .*{fault}"):
        list(read_black_box(written(tmp_path / "kart.mcap", turn)))


def test_what_a_kart_does_not_know_is_no_fault(tmp_path: Path) -> None:
    known = TURN | {"state": [1.0, 2.0, 0.5, 3.0], "deviation": 0.1}
    unknown = TURN | {"time_s": 2, "state": [None, None, None, None], "command": [None, 0.0, 0.6]}
    path = written(tmp_path / "kart.mcap", TURN, known, unknown)
    assert list(read_black_box(path)) == [TURN, known, unknown]
    told = CliRunner().invoke(app, ["black-box", str(path)])
    assert (told.exit_code, told.exception) == (0, None)
    assert "3 turns in 1 s" in told.stdout


def test_turns_are_read_up_to_one_whose_brackets_go_too_deep(tmp_path: Path) -> None:
    path = written(tmp_path / "kart.mcap", TURN, b"[" * 200_000)
    assert list(read_black_box(path)) == [TURN]


def test_a_file_whose_packed_part_is_damaged_is_refused_in_one_sentence(tmp_path: Path) -> None:
    path = written(tmp_path / "kart.mcap", TURN, packed=CompressionType.LZ4)
    content = bytearray(path.read_bytes())
    frame = content.index(b"lz4") + 15
    for place in range(frame, frame + 15):
        content[place] ^= 0x5A
    path.write_bytes(content)
    with pytest.raises(RecordingError, match=r"kart\.mcap is no black box of a kart"):
        list(read_black_box(path))
