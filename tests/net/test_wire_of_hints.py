"""What a coach tells a driver, as a message."""

import math
from dataclasses import replace

import pytest

from race_server.core.hint import Hint, HintKind
from race_server.errors import WireError
from race_server.net.wire.hint import decode_hint, encode_hint
from support.messages import HINT


@pytest.mark.parametrize(
    "hint",
    [
        HINT,
        Hint(),
        Hint(lap=1, time_us=30_000_000, reason="from the start"),
        Hint(kind=HintKind.LIFT, corner="T12", size=4.0, helped=((0.0, 9.5),)),
    ],
)
def test_a_hint_comes_back_as_it_was_sent(hint: Hint) -> None:
    assert decode_hint(encode_hint(7, hint)) == (7, hint)


@pytest.mark.parametrize(
    "wrong", [{"size": math.nan}, {"reach": math.inf}, {"helped": ((0.0, math.nan),)}]
)
def test_a_hint_of_no_number_is_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(WireError):
        decode_hint(encode_hint(7, replace(HINT, **wrong)))


def test_a_course_of_a_hundred_corners_fits_into_a_hint() -> None:
    many = tuple((float(place), place + 0.5) for place in range(100))
    _, back = decode_hint(encode_hint(7, replace(HINT, helped=many, reason="x" * 300)))
    assert back.helped == many[:64]
    assert back.reason == "x" * 80
