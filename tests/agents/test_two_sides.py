"""The two sides of a kart's program, and the mailboxes between them."""

import contextlib
import errno
import math
import subprocess
import sys
import time
from dataclasses import replace
from io import FileIO
from pathlib import Path

import numpy as np
import pytest

from race_agents.onboard.black_box import BlackBox, read_black_box
from race_agents.onboard.incident_ring import IncidentRing
from race_agents.onboard.kept_output import KeptOutput
from race_agents.onboard.safety_side import Mailboxes, SafetySide
from race_agents.plant.encounter import FreeRun, OpenPlace
from race_agents.plant.kart import Plant
from race_agents.plant.radar import Surroundings
from race_agents.plant.sensors import Sensors
from race_agents.unit import readings
from race_agents.unit.control_unit import ControlUnit
from race_agents.unit.mailbox import CRC, HEAD, Freshness, Mailbox, size_of
from race_agents.unit.orders import GivenOrders
from race_agents.unit.records import Report, Word
from race_agents.unit.sensor_watch import SensorWatch
from race_server.core.alert import Advice, Alert, Cause, Danger, DangerStage
from race_server.core.messages import Button, Control, Flag, Pose, RayHit, Source, Trust
from race_server.core.peer import Peer
from race_server.core.telemetry import Sensor, SensorState
from race_server.core.vehicle_presets import KART_60
from race_server.errors import RecordingError
from race_server.scenario import sensors


def test_the_newest_message_is_read_and_a_half_written_one_is_none() -> None:
    memory = bytearray(size_of(8))
    box = Mailbox(memory, 8)
    assert box.read() is None
    box.write(b"one", 1.0)
    box.write(b"two", 2.0)
    mail = box.read()
    assert mail is not None
    assert (mail.counter, mail.time_s, mail.data) == (2, 2.0, b"two")
    # The third goes where the first was. A writer that is killed within it leaves the second one.
    box.write(b"three", 3.0)
    slot = HEAD.size + 8 + CRC.size
    memory[slot + HEAD.size + 2] ^= 0xFF
    mail = box.read()
    assert mail is not None
    assert mail.data == b"two"


def test_every_byte_of_a_message_counts() -> None:
    memory = bytearray(size_of(4))
    Mailbox(memory, 4).write(b"word", 1.0)
    slot = HEAD.size + 4 + CRC.size
    for place in range(slot, 2 * slot):
        damaged = bytearray(memory)
        damaged[place] ^= 0x01
        assert Mailbox(damaged, 4).read() is None, place


def test_a_counter_that_stands_still_is_silence() -> None:
    box, fresh = Mailbox(bytearray(size_of(1)), 1), Freshness()
    box.write(b"a", 0.0)
    assert fresh.note(box.read(), 1.0)
    assert not fresh.note(box.read(), 2.0)
    assert fresh.since_s == 1.0


def test_an_older_message_that_is_left_whole_is_no_new_one() -> None:
    memory = bytearray(size_of(1))
    box, fresh = Mailbox(memory, 1), Freshness()
    for letter in (b"a", b"b"):
        box.write(letter, 0.0)
    assert fresh.note(box.read(), 1.0)
    memory[box.place_of(2) + HEAD.size] ^= 0xFF  # the fourth is half written over the second
    mail = box.read()
    assert mail is not None
    assert mail.data == b"a"
    assert not fresh.note(mail, 2.0)
    assert fresh.since_s == 1.0


def test_words_and_reports_come_out_as_they_went_in() -> None:
    orders = GivenOrders(9.5, 0.5, 3, 70, 8, 0.25, 0.5, 1 << 40, 1.5, Flag.YELLOW, Trust.DOUBTFUL)
    word = Word(orders, 12.5, Control(0.25, -0.5, 0.125, Button.USE_ITEM), 7)
    assert Word.unpack(word.pack()) == word
    others = (Peer(-5, 1.5, -2.5, 0.5, 3.0), Peer(1 << 40, 9.0, 8.0, 0.25, -1.0, braking=6.5))
    assert Word.unpack(replace(word, peers=others).pack()).peers == others
    assert Word.unpack(Word().pack()) == Word()
    endless = replace(word, orders=replace(orders, speed_cap=math.inf))
    assert Word.unpack(endless.pack()) == endless
    pose = Pose(99, 1.5, -2.5, 0.5, 3.0, 0.25, -0.125, 0.0625, 0.5, 0.75, Source.BEACONS, 0)
    danger = Danger(DangerStage.EASE, RayHit.PERSON, -0.25, 4.0, 0.5, 6.0, Advice.BRAKE)
    report = Report(
        pose,
        Alert(98, danger, Cause.OBSTACLE | Cause.GAME),
        Button.USE_ITEM,
        np.array([1.0, 0.0, 2.5]),
        is_through=True,
        braking=6.5,
    )
    again = Report.unpack(report.pack())
    assert (again.pose, again.alert, again.buttons) == (pose, report.alert, Button.USE_ITEM)
    assert (again.is_through, again.is_cut, again.braking) == (True, False, 6.5)
    assert again.ranges is not None
    assert again.ranges.tolist() == [1.0, 0.0, 2.5]
    assert Report.unpack(Report().pack()).pose is None


def test_the_largest_lidar_of_a_race_fits_and_a_larger_one_is_silent() -> None:
    assert readings.MOST_RAYS == sensors.MOST_RAYS == 2048
    boxes = Mailboxes.over(bytearray(Mailboxes.size()))
    ranges = np.linspace(1.0, 2.0, 2048)
    boxes.reports.write(Report(ranges=ranges).pack(), 1.0)
    report = boxes.report()
    assert report is not None
    assert report.ranges == pytest.approx(ranges, abs=0.0)
    watch = SensorWatch(KART_60)
    told = readings.Readings(0.0, 0.0, 0.0, 0.0, ranges=np.ones(2049))
    assert watch.take(told, 0.0, 0.0).ranges is None
    assert watch.state(Sensor.LIDAR) is SensorState.ABSENT


def driven_side() -> tuple[SafetySide, Plant, float]:
    """Return a side that drives 50 km/h after three seconds of words."""
    around = Surroundings(np.zeros((0, 4)))
    plant = Plant.of(KART_60, around, (0.0, 0.0, 0.0), Sensors(fix_delay_s=0.0), 1)
    unit = ControlUnit.of(KART_60, OpenPlace())
    side = SafetySide(unit, plant, Mailboxes.over(bytearray(Mailboxes.size())))
    plant.body.speed, plant.body.brake, now_s = 50.0 / 3.6, 0.0, 0.0
    for turn in range(100):
        now_s = 0.01 * turn
        if turn % 2 == 0:  # the game's side turns half as often
            missing = 50.0 / 3.6 - plant.body.speed
            control = Control(0.0, max(0.0, min(0.3 + missing, 1.0)))
            word = Word(FreeRun(), now_s, control, 1 + turn)
            side.boxes.words.write(word.pack(), now_s)
        side.turn(now_s)
    return side, plant, now_s


def test_without_words_the_motor_goes_off_and_the_brakes_begin_within_a_fifth_of_a_second() -> None:
    side, plant, now_s = driven_side()
    assert plant.command.throttle > 0.0
    assert plant.command.cause is Cause.NONE
    seen = {}
    for turn in range(1, 40):
        side.turn(now_s + 0.01 * turn)
        if plant.command.throttle == 0.0:
            seen.setdefault("coasts", turn)
        if plant.command.brake > 0.0:
            seen.setdefault("brakes", turn)
    # The last word was heard one turn before the last of those that heard any.
    assert seen["coasts"] == pytest.approx(10, abs=2)
    assert seen["brakes"] == pytest.approx(15, abs=2)
    assert Cause.GAME in side.unit.alert().cause


def test_words_come_again_and_the_kart_drives_on() -> None:
    side, plant, now_s = driven_side()
    side.turn(now_s + 0.3)
    assert plant.command.brake > 0.0
    side.boxes.words.write(Word(FreeRun(), now_s + 0.31, Control(0.0, 0.5), 999).pack(), now_s)
    side.turn(now_s + 0.31)
    assert (plant.command.brake, plant.command.throttle) == (0.0, 0.5)


def test_a_side_that_nobody_talks_to_for_long_ends() -> None:
    side, _, now_s = driven_side()
    assert not side.is_alone(now_s + 5.0)
    assert side.is_alone(now_s + 11.0)


def test_a_side_that_never_hears_a_word_ends_after_a_minute() -> None:
    around = Surroundings(np.zeros((0, 4)))
    plant = Plant.of(KART_60, around, (0.0, 0.0, 0.0), Sensors(), 1)
    unit = ControlUnit.of(KART_60, OpenPlace())
    side = SafetySide(unit, plant, Mailboxes.over(bytearray(Mailboxes.size())))
    assert not side.is_alone(1000.0)  # it has not turned yet
    side.turn(1000.0)
    assert not side.is_alone(1059.0)
    assert side.is_alone(1061.0)


def test_the_safety_process_of_a_plant_imports_no_network() -> None:
    program = (
        "import os, sys; os.environ['RACE_SERVER_INTERPRET'] = '1';"
        "import race_agents.plant.safety_process;"
        "print([name for name in ('zenoh', 'asyncio', 'numba', 'race_server.net')"
        " if name in sys.modules])"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "[]"


def test_a_ring_keeps_the_minute_before_a_kart_brakes_by_itself(tmp_path: Path) -> None:
    ring = IncidentRing()
    second = 1_000_000_000
    quiet = [ring.pass_on((n * second, {}), float(n), happens=False) for n in range(100)]
    assert not any(quiet)
    kept = ring.pass_on((100 * second, {}), 100.0, happens=True)
    assert [kept[0][0] // second, kept[-1][0] // second, len(kept)] == [39, 100, 62]
    after = [len(ring.pass_on((n * second, {}), float(n), happens=False)) for n in range(101, 121)]
    assert after == [1] * 10 + [0] * 10

    side, _, now_s = driven_side()
    path = tmp_path / "kart.mcap"
    with BlackBox(path, IncidentRing()) as box:
        side.box = box
        for turn in range(1, 31):  # it brakes 0.15 s after the last word
            side.turn(now_s + 0.01 * turn)
        side.box = None
    turns = list(read_black_box(path))
    assert len(turns) == 30
    assert turns[0]["cause"] == []
    assert "game" in turns[-1]["cause"]


def test_a_ring_holds_a_minute_also_after_the_clock_was_set_back() -> None:
    ring, second = IncidentRing(), 1_000_000_000
    ring.pass_on((5000 * second, {}), 5000.0, happens=True)
    times = [*range(5011, 5100), *range(100, 300)]
    assert not any(ring.pass_on((n * second, {}), float(n), happens=False) for n in times)
    kept = ring.pass_on((300 * second, {}), 300.0, happens=True)
    assert [at // second for at, _ in kept] == [*range(239, 301)]
    # And ten seconds more, though the clock is set back just then.
    after = [len(ring.pass_on((n * second, {}), float(n), happens=False)) for n in range(20, 40)]
    assert after == [1] * 11 + [0] * 9


def test_a_black_box_goes_on_once_a_full_disk_takes_more_and_says_so_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    refused: list[int] = []

    class FullDisk(FileIO):
        def write(self, data: bytes) -> int:
            if len(refused) < 3:
                refused.append(len(data))
                raise OSError(errno.ENOSPC, "No space left on device")
            return super().write(data)

    class Kept(KeptOutput):
        def __init__(self, path: Path) -> None:
            super().__init__(path)
            self._file.close()
            self._file = FullDisk(path, "w")

    for name in ("FLUSH_S", "RETRY_S"):
        monkeypatch.setattr(f"race_agents.onboard.black_box.{name}", 0.05)
    monkeypatch.setattr("race_agents.onboard.black_box.KeptOutput", Kept)
    side, _, now_s = driven_side()
    with BlackBox(tmp_path / "kart.mcap") as box:
        side.box = box
        for turn in range(1, 31):
            side.turn(now_s + 0.01 * turn)
        deadline = time.monotonic() + 10.0
        while len(refused) < 3 and time.monotonic() < deadline:
            time.sleep(0.02)
        for turn in range(31, 41):
            side.turn(now_s + 0.01 * turn)
        side.box = None
    assert len(list(read_black_box(tmp_path / "kart.mcap"))) == 40
    assert capsys.readouterr().err.count("No space left on device") == 1


def test_a_black_box_holds_each_turn_and_survives_a_torn_end(tmp_path: Path) -> None:
    side, _, now_s = driven_side()
    path = tmp_path / "kart.mcap"
    with BlackBox(path) as box:
        side.box = box
        for turn in range(1, 31):  # no word comes any more
            side.turn(now_s + 0.01 * turn)
        side.box = None
    turns = list(read_black_box(path))
    assert len(turns) == 30
    assert turns[0]["time_s"] == pytest.approx(now_s + 0.01)
    assert turns[0]["state"][3] == pytest.approx(50.0 / 3.6, abs=0.3)
    assert turns[0]["cause"] == []
    assert "game" in turns[-1]["cause"]
    assert turns[-1]["command"][2] == 0.6
    torn = tmp_path / "torn.mcap"
    torn.write_bytes(path.read_bytes()[:-200])
    assert len(list(read_black_box(torn))) in {0, 30}
    with pytest.raises(RecordingError, match="no black box"):
        list(read_black_box(Path(__file__)))
    whole = path.read_bytes()
    for place in range(9, 900, 7):  # a byte that was written wrongly
        torn.write_bytes(whole[:place] + bytes([whole[place] ^ 0xFF]) + whole[place + 1 :])
        with contextlib.suppress(RecordingError):
            list(read_black_box(torn))
