"""The colours of a picture."""

from race_server.core import codes
from race_server.core.state import Record

Colour = tuple[int, int, int]

# Colours that stay apart for colour-blind eyes: Okabe and Ito, "Color Universal Design", 2008.
PALETTE: tuple[Colour, ...] = (
    (230, 159, 0),  # orange
    (86, 180, 233),  # sky blue
    (0, 158, 115),  # bluish green
    (240, 228, 66),  # yellow
    (0, 114, 178),  # blue
    (213, 94, 0),  # vermilion
    (204, 121, 167),  # reddish purple
    (0, 0, 0),  # black
)
RETIRED_GREY: Colour = (160, 164, 170)

PAGE: Colour = (243, 244, 240)
GRASS: Colour = (207, 227, 196)
KERB: Colour = (217, 83, 79)
ASPHALT: Colour = (104, 109, 117)
CENTRE: Colour = (146, 151, 158)
INK: Colour = (32, 36, 42)
FAINT: Colour = (128, 133, 140)
CONCRETE: Colour = (216, 211, 198)
AMBER: Colour = (255, 191, 0)
OIL: Colour = (18, 18, 22)
WHITE: Colour = (255, 255, 255)
STANDING: Colour = (170, 178, 189)
PERSON: Colour = (242, 123, 165)
MINE: Colour = (63, 191, 127)


def colour_of(body: Record, k: int) -> Colour:
    """Return the colour of the kart with number k."""
    return RETIRED_GREY if body.status == codes.RETIRED else PALETTE[k % len(PALETTE)]


def mixed(colour: Colour, ground: Colour, share: float) -> Colour:
    """Return a colour that lets the ground through: share 1 is the colour alone."""
    red, green, blue = (
        round(share * over + (1.0 - share) * under)
        for over, under in zip(colour, ground, strict=True)
    )
    return red, green, blue


def ink_on(colour: Colour) -> Colour:
    """Return the ink that can be read on a colour."""
    red, green, blue = colour
    return INK if 0.3 * red + 0.59 * green + 0.11 * blue > 110.0 else WHITE
