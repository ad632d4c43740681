"""The languages of a sheet: what its tables say, by what they say in English.

Names of teams, drivers, courses and formats, and what people wrote, are as they were given.
"""

import re
from collections.abc import Callable
from dataclasses import replace

from race_server.competition.race_day.tables import STEWARDS, DayTable
from race_server.errors import ScenarioError

LANGUAGES = ENGLISH, FRENCH = "en", "fr"

Say = Callable[[str], str]

_WORDS = {
    "team": "équipe",
    "driver": "pilote",
    "counts": "retenu",
    "touches": "contacts",
    "remarks": "remarques",
    "grid": "grille",
    "laps": "tours",
    "time": "temps",
    "best lap": "meilleur tour",
    "warnings": "avert.",
    "qualifying": "qualification",
    "best race lap": "meilleur tour",
    "about": "au sujet de",
    "by": "par",
    "against": "contre",
    "why": "motif",
    "decision": "décision",
    STEWARDS: "commissaires",
    "failed": "échec",
    "out": "ab.",
    "n. c.": "n. c.",
    "empty": "vide",
    "open": "en attente",
    "upheld": "acceptée",
    "dismissed": "rejetée",
    "disqualified": "disqualification",
    "Final classification": "Classement final",
    "Protests": "Réclamations",
    "no team finished": "aucune équipe à l'arrivée",
    "out of time": "hors délai",
    "crashed": "accident",
    "withdrew": "retrait",
    "position lost": "position perdue",
    "touched a border": "bordure touchée",
    "left the course": "sortie de piste",
    "was rescued": "secouru",
    "was not seen for a while": "perdu de vue un moment",
    "the wrong way": "contresens",
    "stood": "arrêt",
    "rammed others": "percussions",
    "their decision": "leur décision",
    "dangerous driving": "conduite dangereuse",
    "defect of the kart": "panne",
    "false start": "faux départ",
    "short cut": "raccourci",
    "penalty": "pénalité",
    "provisional": "provisoire",
    "next": "ensuite",
}
_STAGES = {"Time trial": "Contre-la-montre", "Heat": "Manche", "Final": "Finale", "Race": "Course"}

# Whole phrases with numbers or names in them; groups in ⟨⟩ are said in French, too.
_PHRASES = (
    (r"(\d+[A-Z]): (.+?)( \(\+\d+\))?", r"\1 : ⟨\2⟩\3"),
    (r"attempt (\d+)", r"essai \1"),
    (r"(.+) m the wrong way", r"\1 m à contresens"),
    (r"stood for (.+) s", r"arrêt de \1 s"),
    (r"rammed others (\d+) times", r"\1 percussions"),
    (r"no answer within (.+) s", r"pas de réponse en \1 s"),
    (r"not there (.+) s after the call", r"absent \1 s après l'appel"),
    (r"did not start: (.+)", r"non partant : ⟨\1⟩"),
    (r"removed by the stewards: (.+)", r"retiré par les commissaires : ⟨\1⟩"),
    (r"disqualified: (.+)", r"disqualifié : \1"),
    (r"left out gate (\d+)", r"porte \1 manquée"),
    (r"(\+.+ s) protest (\d+)", r"\1 réclamation \2"),
    (r"(\+.+ s) (.+)", r"\1 ⟨\2⟩"),
    (r"upheld, (\+.+ s)", r"acceptée, \1"),
    (r"lap (\d+) (.+)", r"tour \1 ⟨\2⟩"),
    (r"(.+), lap (\d+)", r"⟨\1⟩, tour \2"),
    (r"1 lap, (.+)", r"1 tour, ⟨\1⟩"),
    (r"(\d+) laps, (.+)", r"\1 tours, ⟨\2⟩"),
    (
        r"(\d+) laps each, place \(points\) by round and track",
        r"\1 tours chacune, place (points) par manche et piste",
    ),
    (r"1 team · (.+)", r"1 équipe · ⟨\1⟩"),
    (r"(\d+) teams · (.+)", r"\1 équipes · ⟨\2⟩"),
    (r"(.+) · tracks (.+) · seed (.+)", r"\1 · pistes \2 · graine \3"),
    (r"(.+) race day", r"\1, journée de courses"),
)
_PARTS_OF_TITLES = (
    (r", round (\d+)", r", tour \1"),
    (r", track (\w+)$", r", piste \1"),
    (r", attempt (\d+)$", r", essai \1"),
)
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
    for name, said in _STAGES.items():
        if re.match(rf"{name}\b(?! classification)", words):
            words = said + words.removeprefix(name)
            for pattern, text in _PARTS_OF_TITLES:
                words = re.sub(pattern, text, words)
            return words
    course, comma, more = words.partition(", ")
    laps = say(more)
    return f"{course}{comma}{laps}" if comma and laps != more else say(words)


def _in_french(words: str) -> str:
    if words in _WORDS:
        return _WORDS[words]
    for phrase, said in _PHRASES:
        if found := re.fullmatch(phrase, words):
            text = found.expand(said)
            return re.sub("⟨(.*)⟩", lambda inner: _in_french(inner[1]), text)
    return words
