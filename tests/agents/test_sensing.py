"""Bytes of receivers, beacons and the bus become readings; damaged ones become nothing."""

import math
import struct
from datetime import time
from io import BytesIO

import can
import pytest
from pynmeagps import NMEAMessage
from pyubx2 import GET, UBXMessage, UBXReader

from race_agents.sensing.bus import (
    COMMAND,
    FELT,
    MOTION,
    BusReader,
    BusWriter,
    check_of,
    layout,
    message_of,
)
from race_agents.sensing.gnss import GnssReader
from race_agents.sensing.place import LocalFrame
from race_agents.sensing.uwb import UwbReader
from race_agents.unit.safety import Command
from race_server.core.alert import Cause
from race_server.core.messages import Source

HALL = LocalFrame(48.8, 2.3)


def pvt(**fields: float) -> bytes:
    """Return a NAV-PVT message; by default of a fixed solution at the origin."""
    usual = {"iTOW": 100_000, "fixType": 3, "gnssFixOk": 1, "diffSoln": 1, "carrSoln": 2}
    usual |= {"lat": 48.8, "lon": 2.3, "hAcc": 14, "gSpeed": 10_000, "headMot": 90.0, "sAcc": 50}
    return UBXMessage("NAV", "NAV-PVT", GET, **{**usual, **fields}).serialize()


def test_a_degree_is_as_long_as_the_ellipsoid_says() -> None:
    # At 48.8° north: 111.21 m for a thousandth of latitude, 73.47 m for one of longitude.
    assert HALL.place(48.801, 2.3, 0.0) == pytest.approx((0.0, 111.21), abs=0.01)
    assert HALL.place(48.8, 2.301, 0.0) == pytest.approx((73.46, 0.0), abs=0.02)


def test_a_course_may_lie_turned() -> None:
    turned = LocalFrame(48.8, 2.3, turn=0.5 * math.pi)
    assert turned.place(48.801, 2.3, 0.0) == pytest.approx((111.21, 0.0), abs=0.01)
    assert turned.heading(0.0) == pytest.approx(0.0)
    assert HALL.heading(90.0) == pytest.approx(0.0)


def test_a_fix_of_ubx_has_place_speed_course_and_how_good_they_are() -> None:
    (fix,) = GnssReader(HALL).read(BytesIO(pvt()))
    assert (fix.x, fix.y) == pytest.approx((0.0, 0.0), abs=0.01)
    assert fix.deviation == pytest.approx(0.0099, abs=1e-4)  # 14 mm in two directions
    assert (fix.speed, fix.course, fix.speed_deviation) == pytest.approx((10.0, 0.0, 0.05))
    assert fix.source is Source.CORRECTED_SATELLITES
    assert fix.stamp_s is None  # no pulse, no stamp
    assert fix.heading is None


def test_a_pulse_gives_fixes_their_stamp() -> None:
    reader = GnssReader(HALL)
    reader.pulse.mark(5000.0, 99.0)  # second 99 of the week was at 5000 s of the kart's clock
    (fix,) = reader.read(BytesIO(pvt()))
    assert fix.stamp_s == pytest.approx(5001.0)


def relative(at_ms: int = 100_000) -> bytes:
    """Return the message of two antennas that face north-east."""
    fields = {"version": 1, "relPosHeading": 45.0, "accHeading": 0.5, "carrSoln": 2}
    valid = {"gnssFixOK": 1, "relPosValid": 1, "relPosHeadingValid": 1}
    return UBXMessage("NAV", "NAV-RELPOSNED", GET, iTOW=at_ms, **fields, **valid).serialize()


def test_two_antennas_tell_the_heading_of_the_same_moment() -> None:
    both, later = GnssReader(HALL).read(BytesIO(relative() + pvt() + pvt(iTOW=100_100)))
    assert both.heading == pytest.approx(math.pi / 4.0)
    assert both.heading_deviation == pytest.approx(math.radians(0.5), abs=1e-6)
    assert later.heading is None


@pytest.mark.parametrize("is_place_first", [True, False])
def test_heading_and_place_of_a_moment_come_in_any_order(is_place_first: bool) -> None:
    stream = b""
    for at_ms in range(100_000, 100_500, 100):
        pair = [pvt(iTOW=at_ms), relative(at_ms)]
        stream += b"".join(pair if is_place_first else pair[::-1])
    fixes = list(GnssReader(HALL).read(BytesIO(stream)))
    assert [fix.heading for fix in fixes] == pytest.approx([math.pi / 4.0] * 5)


def read_one_by_one(*messages: bytes) -> list[int]:
    """Return how many fixes each message completes."""
    reader = GnssReader(HALL)
    return [len(reader.take(UBXReader.parse(each))) for each in messages]


def test_a_fix_is_given_with_the_last_message_of_its_moment_and_does_not_wait_for_the_next() -> (
    None
):
    moments = [(pvt(iTOW=at_ms), relative(at_ms)) for at_ms in (100_000, 100_100, 100_200)]
    # Of the first moment nothing is known yet: it is given as the second begins.
    assert read_one_by_one(*moments[0], *moments[1], *moments[2]) == [0, 0, 1, 1, 0, 1]
    # Where the heading is missing once, the place is given as the next moment begins.
    assert read_one_by_one(*moments[0], moments[1][0], *moments[2]) == [0, 0, 1, 1, 1]


def test_the_end_of_a_moment_gives_its_fix_and_a_moment_long_past_gives_none() -> None:
    end = UBXMessage("NAV", "NAV-EOE", GET, iTOW=100_000).serialize()
    assert read_one_by_one(pvt(), end) == [0, 1]
    assert read_one_by_one(pvt(), pvt(iTOW=100_600)) == [0, 1]  # the second one


def test_what_is_no_fix_is_none_and_satellites_alone_are_said_to_be() -> None:
    stream = pvt(gnssFixOk=0) + pvt(fixType=0) + pvt(carrSoln=0, diffSoln=0, hAcc=2000)
    (fix,) = GnssReader(HALL).read(BytesIO(stream))
    assert fix.source is Source.SATELLITES
    assert fix.deviation == pytest.approx(1.414, abs=1e-3)


def nmea(quality: int, *, at: str = "00:01:22.2", order: str = "RMC GST GGA") -> bytes:
    when = {"time": at}
    place = {"lat": 48.801, "NS": "N", "lon": 2.3, "EW": "E"}
    rest = {"alt": 0.0, "altUnit": "M", "sep": 0.0, "sepUnit": "M"}
    rmc = NMEAMessage("GN", "RMC", 0, **when, status="A", **place, spd=20.0, cog=0.0)
    gst = NMEAMessage("GN", "GST", 0, **when, stdLat=0.03, stdLong=0.02, stdAlt=0.05)
    gga = NMEAMessage("GN", "GGA", 0, **when, **place, quality=quality, numSV=12, HDOP=0.6, **rest)
    told = {"RMC": rmc, "GST": gst, "GGA": gga}
    return b"".join(told[name].serialize() for name in order.split())


def test_three_sentences_of_nmea_make_one_fix() -> None:
    reader = GnssReader(HALL)
    reader.pulse.mark(5000.0, 100.0)  # 00:01:22 of the day is second 100 of the week (18 leaps)
    (fix,) = reader.read(BytesIO(nmea(4)))
    assert (fix.x, fix.y) == pytest.approx((0.0, 111.21), abs=0.02)
    assert fix.deviation == 0.03
    assert fix.speed == pytest.approx(10.29, abs=0.01)
    assert fix.course == pytest.approx(0.5 * math.pi)
    assert fix.stamp_s == pytest.approx(5000.2)
    assert time(0, 1, 22).second == 22


@pytest.mark.parametrize("order", ["RMC GST GGA", "GGA GST RMC", "RMC GGA GST", "GST GGA RMC"])
def test_sentences_of_a_moment_come_in_any_order(order: str) -> None:
    stream = b"".join(nmea(1, at=f"00:01:22.{tenth}", order=order) for tenth in range(4))
    fixes = list(GnssReader(HALL).read(BytesIO(stream)))
    assert [fix.deviation for fix in fixes] == [0.03] * 4
    assert [fix.speed for fix in fixes] == pytest.approx([10.29] * 4, abs=0.01)


def test_damaged_bytes_are_counted_and_what_follows_is_read() -> None:
    broken = bytearray(pvt())
    broken[40] ^= 0xFF
    reader = GnssReader(HALL)
    fixes = list(reader.read(BytesIO(bytes(broken) + b"noise" + pvt() + pvt()[:50])))
    assert len(fixes) == 1
    assert reader.damaged >= 1


def test_a_sentence_with_an_empty_field_is_counted_and_what_follows_is_read() -> None:
    def sentence(words: str) -> bytes:
        check = 0
        for letter in words.encode():
            check ^= letter
        return f"${words}*{check:02X}\r\n".encode()

    without_time = sentence("GNGGA,,4807.038,N,01131.000,E,4,08,0.9,545.4,M,46.9,M,,")
    without_length = sentence("GNGGA,120000.00,4807.038,N,,E,4,08,0.9,545.4,M,46.9,M,,")
    reader = GnssReader(HALL)
    assert len(list(reader.read(BytesIO(without_time + without_length + pvt())))) == 1
    assert reader.damaged == 2


def answer(*anchors: tuple[int, int, int, int, int, int]) -> bytes:
    """Return an answer of a tag: distance, quality, x, y, z [mm] of each anchor."""
    rows = b"".join(
        struct.pack("<HIBiiiB", address, far, quality, x, y, z, 100)
        for address, far, quality, x, y, z in anchors
    )
    ranges = bytes([len(anchors)]) + rows
    return b"\x40\x01\x00" + b"\x41\x0d" + bytes(13) + bytes([0x49, len(ranges)]) + ranges


def test_ranges_are_laid_into_the_plane() -> None:
    # 5 m away and 3 m higher: 4 m in the plane, and 0.1 m of the one is 0.125 m of the other.
    (told,) = UwbReader().read(answer((1, 5000, 100, 1000, 2000, 3000)))
    assert (told.x, told.y, told.distance, told.deviation) == pytest.approx((1.0, 2.0, 4.0, 0.125))


def test_a_range_of_low_quality_is_wide_and_one_of_none_is_dropped() -> None:
    (wide,) = UwbReader().read(answer((1, 5000, 25, 0, 0, 0), (2, 5000, 0, 0, 0, 0)))
    assert wide.deviation == pytest.approx(0.2)  # it hangs as high as the tag


def test_an_answer_that_is_cut_gives_no_ranges() -> None:
    reader = UwbReader()
    assert reader.read(answer((1, 5000, 100, 0, 0, 0))[:-3]) == ()
    assert reader.damaged == 1


def test_the_check_is_that_of_sae_j1850() -> None:
    # The catalogue's check value of "123456789" is 0x4B; here its first two bytes are the number.
    assert check_of(0x3231, b"3456789" + b"\0") == 0x4B


def motion(counter: int) -> can.Message:
    return message_of(MOTION, {"WheelSpeed": 12.5, "YawRate": -0.5, "Steering": 0.2}, counter)


def test_sensors_are_read_off_the_bus() -> None:
    with (
        can.Bus("kart", interface="virtual") as sensors,
        can.Bus("kart", interface="virtual") as unit,
    ):
        reader = BusReader()
        sensors.send(motion(1))
        sensors.send(message_of(FELT, {"Ahead": -4.0, "Left": 2.0}, 1))
        for _ in range(2):
            message = unit.recv(1.0)
            assert message is not None
            reader.take(message, 10.0)
        assert reader.motion() == pytest.approx((12.5, -0.5, 0.2))
        assert reader.felt(10.0) == pytest.approx((-4.0, 2.0))
        assert reader.silent(10.0) == []
        assert reader.silent(10.1) == [MOTION, FELT]
        assert reader.felt(10.1) is None


def test_a_counter_that_stands_still_is_silence_and_a_wrong_check_is_dropped() -> None:
    reader = BusReader()
    reader.take(motion(1), 0.0)
    reader.take(motion(1), 1.0)
    assert MOTION in reader.silent(1.0)
    broken = motion(2)
    broken.data[0] ^= 1
    reader.take(broken, 1.0)
    assert reader.damaged == 1
    reader.take(motion(2), 1.0)
    assert MOTION not in reader.silent(1.0)


def test_a_command_is_cut_off_at_its_range_and_carries_its_cause() -> None:
    with (
        can.Bus("act", interface="virtual") as unit,
        can.Bus("act", interface="virtual") as actuators,
    ):
        BusWriter(unit).act(Command(2.0, -0.5, 1.0, Cause.OBSTACLE | Cause.LINK))
        message = actuators.recv(1.0)
    assert message is not None
    told = layout().get_message_by_name(COMMAND).decode(message.data)
    assert told["Steering"] == pytest.approx(1.0)
    assert told["Throttle"] == pytest.approx(-0.5)
    assert told["Brake"] == pytest.approx(1.0)
    assert told["Cause"] == int(Cause.OBSTACLE | Cause.LINK)
    assert message.data[-1] == check_of(512, bytes(message.data))
