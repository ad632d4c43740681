"""Conduct between karts: which one is blocked, what is a contact, which one is at fault."""

import math

from race_server.core.kernels.jit import kernel

# A blow is taken by the front if its direction and the heading differ by less than 45°.
FRONT = math.sqrt(0.5)
# Two bodies that lean against each other touch again and again: that is one contact until they
# have been apart for this number of ticks.
TOUCH_TICKS = 30


@kernel
def is_in_the_way(
    along: float,
    across: float,
    turn: float,
    length: float,
    width: float,
    other_length: float,
    other_width: float,
) -> bool:
    """Return whether another body stands right ahead, within one length of the nose.

    along, across: from the middle of the body to the other's middle, in its own frame [m];
    turn: from its heading to the other's [rad]; length, width: of the body [m]; other_length,
    other_width: of the other one [m].
    """
    cos, sin = abs(math.cos(turn)), abs(math.sin(turn))
    reach_along = 0.5 * (other_length * cos + other_width * sin)
    reach_across = 0.5 * (other_length * sin + other_width * cos)
    gap = along - reach_along - 0.5 * length
    return along > 0.0 and gap <= length and abs(across) < 0.5 * width + reach_across


@kernel
def is_ramming(
    facing: float, nose: float, closing: float, approach: float, ram_speed: float
) -> bool:
    """Return whether a blow is one kart driving into another from behind, and hard.

    facing: cosine of the angle between its heading and the way to the other along the blow;
    nose: of the front's middle, ahead of the other's middle in the other's frame [m];
    closing: speed at which the two come together [m/s], and `approach` its own part of it;
    ram_speed: a softer touch is racing [m/s], zero where nothing is judged.
    """
    if ram_speed <= 0.0 or closing <= ram_speed:
        return False
    # A kart is not at fault where the other one reverses into it.
    return facing > FRONT and nose < 0.0 and approach >= 0.5 * closing


@kernel
def is_new_touch(tick: int, last_tick: int, contacts: int) -> bool:
    """Return whether a touch begins a new contact; the first one of a race always does.

    last_tick: of the contact counted last; contacts: counted so far.
    """
    return contacts == 0 or tick - last_tick > TOUCH_TICKS
