"""Rows of slots in a file, of a car park or beside a track."""

import math

import numpy as np

from race_server.scenario.toml_reader import TomlReader
from race_server.scenario.track.limits import MOST_SLOTS
from race_server.scenario.track.lot import Floats

# Of a row of slots: the direction in which they follow each other, and their own headings.
_TURNS = ("towards", "heading")


def slots_in(reader: TomlReader, key: str) -> Floats:
    """Return the slots of all rows under a key, shape (S, 5), see `Lot.slots`.

    Raises:
        RaceError: of the reader's kind; a row is not valid, or there are too many slots.
    """
    slots = []
    for row in reader.tables(key):
        x, y = row.pair("at") or (0.0, 0.0)
        towards, heading = (math.radians(row.number(name, 0.0, -360.0, 360.0)) for name in _TURNS)
        length, width = row.number("length", 5.0, 0.5, 50.0), row.number("width", 2.5, 0.3, 20.0)
        pitch = row.number("pitch", width, 0.3, 60.0)
        for number in range(row.whole("count", 1, 1, MOST_SLOTS)):
            at_x = x + number * pitch * math.cos(towards)
            at_y = y + number * pitch * math.sin(towards)
            slots.append((at_x, at_y, heading, length, width))
        row.no_more()
    if len(slots) > MOST_SLOTS:
        raise reader.wrong(key, f"{len(slots)} slots", f"give up to {MOST_SLOTS}")
    return np.array(slots).reshape(-1, 5)
