"""The boxes of vehicles and their trailers as rows of numbers, and which of them come near.

A row holds x, y [m] of the middle, cosine and sine of the heading, half length and half width [m].
"""

import numpy as np
from numpy.typing import NDArray

from race_server.core.state import Floats, Records

Bools = NDArray[np.bool_]


def boxes_of(bodies: Records, vehicles: Records) -> Floats:
    """Return the boxes of V vehicles and of their trailers behind them, (V, U, 6).

    bodies: (V,) BODY; vehicles: (V,) VEHICLE. Rows of trailers that a vehicle does not have are
    NaN.
    """
    x, y, heading = (np.asarray(bodies[name]) for name in ("x", "y", "heading"))
    half_length, half_width = 0.5 * vehicles["length"], 0.5 * vehicles["width"]
    rows = [_rows(x, y, heading, vehicles["box_offset"], half_length, half_width)]
    counts, back = np.asarray(vehicles["trailer_count"]), np.asarray(vehicles["rear_axle"])
    for number in range(int(counts.max(initial=0))):
        drawn, turned = vehicles["trailers"][:, number], bodies["trailers"][:, number]
        back = back + drawn["hitch"]
        x, y = x - back * np.cos(heading), y - back * np.sin(heading)
        heading, back = np.asarray(turned["heading"]), np.zeros(len(x))
        x, y = x - drawn["bar"] * np.cos(heading), y - drawn["bar"] * np.sin(heading)
        front, rear = drawn["bar"] + drawn["ahead"], drawn["behind"]  # [m] from its axle
        size = 0.5 * (front - rear), 0.5 * (front + rear), 0.5 * drawn["width"]
        boxes = _rows(x, y, heading, *size)
        boxes[counts <= number] = np.nan
        rows.append(boxes)
    return np.stack(rows, axis=1)


def _rows(
    x: Floats, y: Floats, heading: Floats, ahead: Floats, half_length: Floats, half_width: Floats
) -> Floats:
    """Return boxes whose middles lie `ahead` [m] of places, (N, 6)."""
    cos, sin = np.cos(heading), np.sin(heading)
    return np.column_stack([x + ahead * cos, y + ahead * sin, cos, sin, half_length, half_width])


def listed(boxes: Floats) -> Floats:
    """Return all boxes of some vehicles, (V, U, 6), as one list (B, 6)."""
    rows = boxes.reshape(-1, 6)
    return rows[~np.isnan(rows[:, 0])]


def meeting(ones: Floats, others: Floats, apart: float) -> Bools:
    """Return which places of two vehicles come nearer than `apart` [m], (P, Q).

    ones: (P, U, 6); others: (Q, V, 6), see `boxes_of`.
    """
    near = touching(ones.reshape(-1, 6), others.reshape(-1, 6), apart)
    boxes = near.reshape(*ones.shape[:2], *others.shape[:2])
    return np.logical_or.reduce(boxes, axis=(1, 3))


def touching(ones: Floats, others: Floats, apart: float) -> Bools:
    """Return which boxes of two lists come nearer than `apart` [m], (P, Q).

    ones: (P, 6); others: (Q, 6), see `boxes_of`. Both grow by half of `apart` on all sides;
    then they overlap unless a line along a side of one separates them.
    """
    reach = np.hypot(ones[:, 4], ones[:, 5])[:, None] + np.hypot(others[:, 4], others[:, 5])
    dx = others[None, :, 0] - ones[:, None, 0]
    dy = others[None, :, 1] - ones[:, None, 1]
    near: Bools = dx * dx + dy * dy < np.square(reach + 2.0 * apart)
    p, q = np.nonzero(near)
    dx, dy = dx[p, q], dy[p, q]
    cos1, sin1, length1, width1 = ones[p, 2:].T
    cos2, sin2, length2, width2 = others[q, 2:].T
    cos, sin = np.abs(cos1 * cos2 + sin1 * sin2), np.abs(sin1 * cos2 - cos1 * sin2)
    length1, width1 = length1 + 0.5 * apart, width1 + 0.5 * apart
    length2, width2 = length2 + 0.5 * apart, width2 + 0.5 * apart
    near[p, q] = (
        (np.abs(dx * cos1 + dy * sin1) < length1 + length2 * cos + width2 * sin)
        & (np.abs(dy * cos1 - dx * sin1) < width1 + length2 * sin + width2 * cos)
        & (np.abs(dx * cos2 + dy * sin2) < length2 + length1 * cos + width1 * sin)
        & (np.abs(dy * cos2 - dx * sin2) < width2 + length1 * sin + width1 * cos)
    )
    return near
