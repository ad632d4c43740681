"""The languages of a sheet: what its tables say, by what they say in English.

Names of teams, drivers, courses and formats, and what people wrote, are as they were given. The
page says them by the same `french.json` (`web/src/i18n/said.ts`).
"""

import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from race_server.competition.race_day.tables import STEWARDS, DayTable
from race_server.errors import ScenarioError

LANGUAGES = ENGLISH, FRENCH = "en", "fr"

Say = Callable[[str], str]

# By what it is in English: `words` and `stages` as they are, `phrases` and `parts_of_titles` with
# numbers or names in them as regular expressions, where groups in ⟨⟩ are said in French, too.
_FRENCH = json.loads(Path(__file__).with_name("french.json").read_text(encoding="utf-8"))
_LEFT_AS_IT_IS = str


def language_of(name: str) -> Say:
    """Return what says a text of a sheet in a language.

    Raises:
        ScenarioError: it is unknown.
    """
    if name not in LANGUAGES:
        raise ScenarioError(f"--language {name!r} is unknown; choose {' or '.join(LANGUAGES)}")
    return _in_french if name == FRENCH else _LEFT_AS_IT_IS


def translated(table: DayTable, say: Say) -> DayTable:
    """Return a table as a language says it. say: of `language_of`."""
    rows = tuple(
        tuple(_cell(column, cell, say) for column, cell in zip(table.columns, row, strict=True))
        for row in table.rows
    )
    title = " · ".join(title_in(part, say) for part in table.title.split(" · "))
    return replace(table, title=title, labels=tuple(map(say, table.columns)), rows=rows)


def _cell(column: str, cell: str, say: Say) -> str:
    if column in {"team", "driver", "against", "why"} or (column == "by" and cell != STEWARDS):
        return cell
    if column == "about":
        return title_in(cell, say)
    parts = re.split("( / |; )", cell)
    return "".join(part if index % 2 else say(part) for index, part in enumerate(parts))


def title_in(words: str, say: Say) -> str:
    """Return the title of a stage, a race or a table; a course in it keeps its name."""
    if say is _LEFT_AS_IT_IS:
        return words
    for name, said in _FRENCH["stages"].items():
        if re.match(rf"{name}\b(?! classification)", words):
            words = said + words.removeprefix(name)
            for pattern, text in _FRENCH["parts_of_titles"]:
                words = re.sub(pattern, text, words)
            return words
    course, comma, more = words.partition(", ")
    laps = say(more)
    return f"{course}{comma}{laps}" if comma and laps != more else say(words)


def _in_french(words: str) -> str:
    if words in _FRENCH["words"]:
        return str(_FRENCH["words"][words])
    for phrase, said in _FRENCH["phrases"]:
        if found := re.fullmatch(phrase, words):
            text = found.expand(said)
            return re.sub("⟨(.*)⟩", lambda inner: _in_french(inner[1]), text)
    return words
