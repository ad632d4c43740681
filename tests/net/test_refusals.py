"""Refusals are counted, and told without filling the log."""

import io
import json

from race_server.errors import Reason
from race_server.live.server.counters import Refusals
from race_server.logs import AGAIN, FIRST, MOST_SENDERS, QUIET_S, Log, RefusalLog


def test_a_refusal_is_counted_each_time_and_told_once_for_each_seat() -> None:
    stream = io.StringIO()
    refusals = Refusals(Log(stream=stream))
    for seat in (2, 2, -1, 2, -1):
        refusals.record(Reason.AGAIN, seat)
    assert refusals[Reason.AGAIN] == 5
    lines = [json.loads(line) for line in stream.getvalue().splitlines()]
    assert [line["event"] for line in lines] == ["refused for the first time"] * 2
    assert [line.get("seat") for line in lines] == [2, None]


def test_a_sender_that_is_refused_without_end_is_one_line_a_minute_and_hides_no_other() -> None:
    stream, now = io.StringIO(), [0.0]
    told = RefusalLog(Log(stream=stream), clock=lambda: now[0])
    for tenth in range(1800):  # for two minutes from its first line on, ten a second
        now[0] = tenth * QUIET_S / 600
        told.record("again", 3, seat=3)
    told.record("again", 4, seat=4)
    told.record("foreign", 3, seat=3)
    lines = [json.loads(line) for line in stream.getvalue().splitlines()]
    assert [(line["event"], line["seat"], line.get("times")) for line in lines] == [
        (FIRST, 3, None),
        (AGAIN, 3, 600),
        (AGAIN, 3, 600),
        (FIRST, 4, None),
        (FIRST, 3, None),
    ]


def test_senders_without_end_share_a_line_until_the_oldest_is_forgotten() -> None:
    stream, now = io.StringIO(), [0.0]
    told = RefusalLog(Log(stream=stream), clock=lambda: now[0])
    for number in range(3 * MOST_SENDERS):
        told.record("token", f"192.0.2.{number}", address=f"192.0.2.{number}")
    lines = [json.loads(line) for line in stream.getvalue().splitlines()]
    assert len(lines) == MOST_SENDERS + 1
    assert lines[-1]["sender"] == f"one of more than {MOST_SENDERS}"
    now[0] = QUIET_S
    told.record("token", "198.51.100.1", address="198.51.100.1")
    assert "198.51.100.1" in stream.getvalue()
