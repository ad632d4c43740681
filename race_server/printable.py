"""Text from outside, for a terminal, a log, a picture or a table: no control characters in it.

A name is data. Escape sequences in it would move the cursor of a terminal, an override of the
writing direction would turn a line around, and a line break would forge another line.
"""

import unicodedata

UNKNOWN = "\N{REPLACEMENT CHARACTER}"


def printable(text: str) -> str:
    """Return text on one line with nothing in it but characters that can be seen, and spaces.

    A wide or tabulating space becomes a plain one. Any other character that a terminal would obey
    or hide becomes `UNKNOWN`: control characters (C0, C1), marks of direction, line breaks, half of
    a surrogate pair.
    """
    if text.isprintable():
        return text
    return "".join(map(_printable, text))


def _printable(letter: str) -> str:
    if letter.isprintable():
        return letter
    is_space = letter == "\t" or unicodedata.category(letter) == "Zs"
    return " " if is_space else UNKNOWN
