"""Random car parks: ``generated:yard:17``, ``generated:aisle:4`` and others, see FORMS.

Kind and seed define the lot: the same name always gives the same file. No lot of a name is among
them, so that what was learned on those can be tried on these.
"""

import math
import re
from functools import cache
from random import Random

from race_server.errors import LotError

KINDS = ("yard", "aisle", "kerb", "street")
FORMS = tuple(f"generated:{kind}:SEED" for kind in KINDS)

_NAME = re.compile(rf"generated:({'|'.join(KINDS)}):(0|[1-9][0-9]{{0,8}})")

# For the angle of bays to their aisle [degrees]: widths of bays and of the aisle [m], between which
# is drawn. The least of each are those of NF P91-100 (public car parks).
BAYS = {90: ((2.5, 2.8), (5.0, 7.0)), 60: ((2.25, 2.6), (4.0, 5.5)), 45: ((2.2, 2.5), (3.5, 5.0))}
BAY = 5.0  # [m] length of a bay
# Lengths and widths of slots along a kerb [m], between which is drawn. The least width is that of
# NF P91-100, the least length 1.13 times the car.
KERB_LENGTHS, KERB_WIDTHS = (5.3, 7.0), (2.0, 2.4)
# Length [m] of all slots along a street, 1.25 times the car, and their widths.
STREET_LENGTH, STREET_WIDTHS = 5.86, (2.25, 2.4)
KERB_BEGINS = 7.0  # [m] where the first slot along a kerb does


@cache
def generated_file(name: str) -> str:
    """Return the file of a generated car park's name.

    Raises:
        LotError: the name is not valid.
    """
    match = _NAME.fullmatch(name)
    if match is None:
        raise LotError(f"lot {name!r} cannot be generated; write {', '.join(FORMS)}")
    kind, seed = match[1], int(match[2])
    chance = Random(f"{kind} {seed}")
    words = [f'title = "Generated {kind} {seed}"', 'level = "parked"']
    words += {"yard": _yard, "aisle": _aisle, "kerb": _kerb, "street": _street}[kind](chance)
    return "\n".join([*words, ""])


def _yard(chance: Random) -> list[str]:
    """Return the words of a yard with blocks and people between start and slot."""
    length, depth = chance.uniform(45.0, 95.0), chance.uniform(24.0, 44.0)
    half = 0.5 * depth - 4.0
    first, last = 4.0 + 0.2 * length, length - 4.0 - 0.2 * length
    fewest = chance.randint(2, 8)
    shortest = chance.uniform(0.5, 1.2)
    people = chance.randint(0, 3)
    slot = (chance.uniform(2.6, 3.4), chance.uniform(1.7, 2.3))
    words = [
        f"area = [0, {length:.1f}, {-0.5 * depth:.2f}, {0.5 * depth:.2f}]",
        f"slot = [{slot[0]:.2f}, {slot[1]:.2f}]",
        "limit_s = 60",
        *_zone("start", (4.0, first), (-half, half), spread=180.0),
        *_zone("goal", (last, length - 4.0), (-half, half), spread=180.0),
        *_zone("blocks", (first + 4.0, last - 4.0), (-half, half)),
        "[blocks]",
        f"count = [{fewest}, {fewest + chance.randint(0, 6)}]",
        f"side = [{shortest:.2f}, {shortest + chance.uniform(0.5, 2.0):.2f}]",
    ]
    if people:
        words += _zone("people", (first + 2.0, last - 2.0), (-half, half))
        words += ["[people]", f"count = {people}"]
    return words


def _aisle(chance: Random) -> list[str]:
    """Return the words of two rows of bays on an aisle; one-way unless at right angles."""
    degrees = chance.choice(tuple(BAYS))
    (narrow, wide), (tight, open_) = BAYS[degrees]
    width, aisle = chance.uniform(narrow, wide), chance.uniform(tight, open_)
    count = chance.randint(6, 20)
    angle = math.radians(degrees)
    pitch = width / math.sin(angle) + 0.002
    depth = BAY * math.sin(angle) + width * math.cos(angle)
    # Beyond the last bay there is room for a vehicle, and for what the bays lean over.
    first, length = 12.0, 24.0 + (count - 1) * pitch
    middle, half = 0.5 * (aisle + depth), 0.5 * aisle + depth + 0.01
    # Driven into forward a bay's heading points away from the aisle, reversed into towards it.
    sides = [(-middle, -degrees), (middle, degrees)]
    if degrees == 90:
        sides = [(y, chance.choice((turn, turn + 180))) for y, turn in sides]
    words = [
        f"area = [0, {length:.2f}, {-half:.2f}, {half:.2f}]",
        'vehicle = "car"',
        "limit_s = 90",
    ]
    for y, heading in sides:
        words += [
            "[[rows]]",
            f"at = [{first:g}, {y:.3f}]",
            f"count = {count}",
            f"pitch = {pitch:.4f}",
            f"heading = {heading}",
            f"length = {BAY}",
            f"width = {width:.3f}",
        ]
    aside = 0.5 * aisle - 1.4
    words += _zone("start", (3.0, 6.0), (-aside, aside), spread=3.0)
    if degrees == 90:
        words += _zone("start", (length - 6.0, length - 3.0), (-aside, aside), 180.0, 3.0)
    share = chance.uniform(0.3, 0.9)
    return [*words, "[taken]", f"share = {share:.2f}", "length = 4.7", "width = 1.9"]


def _kerb(chance: Random) -> list[str]:
    """Return the words of slots along a kerb, which a car may overhang, each of another length."""
    sides = _sides_of_a_kerb(chance, KERB_WIDTHS)
    words: list[str] = []
    last = KERB_BEGINS
    for _ in range(chance.randint(4, 10)):
        length = round(chance.uniform(*KERB_LENGTHS), 2)
        words += _along_a_kerb(last, length, sides[0])
        last += length
    return _with_a_kerb(chance, words, last, sides, (3.0, 8.0))


def _street(chance: Random) -> list[str]:
    """Return the words of slots along a kerb, which a car may overhang, all of one size."""
    sides = _sides_of_a_kerb(chance, STREET_WIDTHS)
    count = chance.randint(4, 10)
    words = _along_a_kerb(KERB_BEGINS, STREET_LENGTH, sides[0])
    words += [f"count = {count}", f"pitch = {STREET_LENGTH}"]
    last = KERB_BEGINS + count * STREET_LENGTH
    return ["distance = [4, 12]", *_with_a_kerb(chance, words, last, sides, (3.0, last))]


def _sides_of_a_kerb(chance: Random, widths: tuple[float, float]) -> tuple[float, float, float]:
    """Return a width of slots, drawn between two, and those of what is behind and before them."""
    return chance.uniform(*widths), chance.uniform(0.3, 0.6), chance.uniform(6.0, 8.0)


def _along_a_kerb(first: float, length: float, width: float) -> list[str]:
    """Return the words of a slot. first: where it begins [m]; length, width: [m]."""
    return [
        "[[rows]]",
        f"at = [{first + 0.5 * length:.3f}, {0.5 * width:.3f}]",
        f"length = {length:.2f}",
        f"width = {width:.3f}",
    ]


def _with_a_kerb(
    chance: Random,
    slots: list[str],
    last: float,
    sides: tuple[float, float, float],
    starts: tuple[float, float],
) -> list[str]:
    """Return the words of a lot. last: end of the last slot; starts: between which they are [m]."""
    width, behind, street = sides
    share = chance.uniform(0.4, 0.95)
    return [
        f"area = [0, {last + 6.0:.2f}, {-behind:.2f}, {width + street:.2f}]",
        'vehicle = "car"',
        "limit_s = 90",
        *slots,
        *_zone("start", starts, (width + 2.0, width + street - 2.0), spread=10.0),
        *["[taken]", f"share = {share:.2f}", "length = 4.7", "width = 1.9"],
    ]


def _zone(
    role: str,
    x: tuple[float, float],
    y: tuple[float, float],
    heading: float = 0.0,
    spread: float = 0.0,
) -> list[str]:
    """Return the words of a zone. x, y: its sides [m]; heading, spread: [degrees]."""
    return [
        "[[zones]]",
        f'role = "{role}"',
        f"x = [{x[0]:.2f}, {x[1]:.2f}]",
        f"y = [{y[0]:.2f}, {y[1]:.2f}]",
        f"heading = {heading:g}",
        f"spread = {spread:g}",
    ]
