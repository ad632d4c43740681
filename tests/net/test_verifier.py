"""What we write, before the verifier of the FlatBuffers library itself."""

from collections.abc import Callable
from pathlib import Path

import ark_fbs
import pytest

from race_server.core.messages import Button, Control
from race_server.errors import WireError
from race_server.net.wire import drive, ghosts, lobby, parking, programme, spectate
from support.messages import (
    EVENTS,
    GHOST,
    LOT,
    ORDER,
    PROGRAMME,
    STANDINGS,
    WELCOME,
    snapshot,
)

SCHEMAS = Path(__file__).parents[2] / "schemas"
CONTROL = drive.encode_control(
    drive.ControlFrame(3, 40, 600, Control(0.25, 1.0, 0.0, Button.USE_ITEM))
)
SNAPSHOT = spectate.SnapshotWriter().write(snapshot())

WRITTEN = {
    ("drive", "ControlMessage"): CONTROL,
    ("spectate", "Snapshot"): SNAPSHOT,
    ("spectate", "Events"): spectate.encode_events(1, EVENTS),
    ("spectate", "Standings"): spectate.encode_standings(STANDINGS),
    ("session", "JoinRequest"): lobby.encode_join(lobby.Join("me", "lidar", 2, 5)),
    ("session", "Briefing"): lobby.encode_welcome(WELCOME),
    ("drive", "ParkingOrder"): parking.encode_order(ORDER),
    ("spectate", "Lot"): parking.encode_lot(LOT),
    ("spectate", "Programme"): programme.encode_programme(PROGRAMME),
    ("spectate", "Ghosts"): ghosts.encode_ghosts(4, (GHOST,)),
    ("session", "Reply"): lobby.encode_reply("no"),
}

DECODERS: dict[tuple[str, str], Callable[[bytes], object]] = {
    ("drive", "ControlMessage"): drive.decode_control,
    ("session", "JoinRequest"): lobby.decode_join,
    ("spectate", "Snapshot"): spectate.decode_snapshot,
    ("drive", "ParkingOrder"): parking.decode_order,
    ("spectate", "Lot"): parking.decode_lot,
    ("spectate", "Programme"): programme.decode_programme,
    ("spectate", "Ghosts"): ghosts.decode_ghosts,
    ("spectate", "Events"): spectate.decode_events,
    ("spectate", "Standings"): spectate.decode_standings,
}


def schema_of(file: str, table: str) -> ark_fbs.Schema:
    name = f"race.{file}.{table}"
    return ark_fbs.Schema.from_fbs_file(str(SCHEMAS / f"{file}.fbs"), root_type_override=name)


@pytest.mark.parametrize(("place", "data"), WRITTEN.items(), ids=lambda place: str(place[1])[:12])
def test_every_message_that_we_write_passes_the_verifier(
    place: tuple[str, str], data: bytes
) -> None:
    assert schema_of(*place).binary_to_json(data)


@pytest.mark.parametrize(("place", "data"), WRITTEN.items(), ids=lambda place: str(place[1])[:12])
def test_a_message_cut_short_passes_neither_the_verifier_nor_us(
    place: tuple[str, str], data: bytes
) -> None:
    schema = schema_of(*place)
    for length in range(0, len(data) - 8, 4):
        with pytest.raises(ark_fbs.Error):
            schema.binary_to_json(data[:length])
    if place in DECODERS:
        for length in range(len(data) - 8):
            with pytest.raises(WireError):
                DECODERS[place](data[:length])
