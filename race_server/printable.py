"""Text from outside, for a terminal, a log, a picture or a table: no control characters in it.

A name is data. Escape sequences in it would move the cursor of a terminal, an override of the
writing direction would turn a line around, and a line break would forge another line.
"""

import unicodedata

UNKNOWN = "\N{REPLACEMENT CHARACTER}"


# What a font may leave out by Unicode, though `str.isprintable` takes it; the empty braille cell.
_HIDDEN = frozenset(
    (
        *("\u034f", "\u115f", "\u1160", "\u17b4", "\u17b5", "\u180f"),
        *("\u2800", "\u3164", "\uffa0"),
        *map(chr, (*range(0x180B, 0x180E), *range(0xFE00, 0xFE10), *range(0xE0100, 0xE01F0))),
    )
)


def fault_of_name(name: str) -> str:
    """Return what is wrong with the characters of a name that is not empty, "" for nothing.

    A name that cannot be seen, or looks like another one but for what cannot be seen, is none.
    """
    if not name.isprintable():
        return "a character that cannot be printed"
    if hidden := next((letter for letter in name if letter in _HIDDEN), ""):
        return f"U+{ord(hidden):04X}, which cannot be seen"
    if name != name.strip():
        return "a space at one end"
    if not any(unicodedata.category(letter)[0] in "LNPS" for letter in name):
        return "no letter, digit or sign"
    return ""


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
