"""The sheet for the wall in French: what the program says, and nothing that people gave."""

import pytest

from race_server.competition.race_day.languages import language_of, translated
from race_server.competition.race_day.tables import DayTable
from race_server.errors import ScenarioError

FRENCH = language_of("fr")


@pytest.mark.parametrize(
    ("english", "french"),
    [
        ("best lap", "meilleur tour"),
        ("attempt 2", "essai 2"),
        ("2 m the wrong way, lap 3", "2 m à contresens, tour 3"),
        ("1B: 2 m the wrong way, lap 5 (+1)", "1B : 2 m à contresens, tour 5 (+1)"),
        ("did not start: not there 60 s after the call", "non partant : absent 60 s après l'appel"),
        (
            "removed by the stewards: rammed others, lap 2",
            "retiré par les commissaires : percussions, tour 2",
        ),
        ("lap 3 touched a border", "tour 3 bordure touchée"),
        ("+5 s false start", "+5 s faux départ"),
        ("+60 s protest 1", "+60 s réclamation 1"),
        ("upheld, +60 s", "acceptée, +60 s"),
        ("8 teams · tt02 · tracks A oval · seed 1", "8 équipes · tt02 · pistes A oval · graine 1"),
        ("a driver wrote this", "a driver wrote this"),
    ],
)
def test_what_a_sheet_says_is_said_in_french(english: str, french: str) -> None:
    assert FRENCH(english) == french
    assert language_of("en")(english) == english


def test_names_and_reasons_of_people_stay_as_they_are_given() -> None:
    rows = (("1", "time", "failed", "out of time, lap 2; disqualified: out of time"),)
    table = DayTable(
        "Heat 2, round 1 · The Final, 2 laps, empty", ("", "team", "a", "remarks"), rows
    )
    french = translated(table, FRENCH)
    assert french.title == "Manche 2, tour 1 · The Final, 2 tours, vide"
    assert french.rows == (("1", "time", "échec", "hors délai, tour 2; disqualifié : out of time"),)
    assert french.heads == ("", "équipe", "a", "remarques")
    assert translated(table, language_of("en")).rows == rows


def test_an_unknown_language_is_refused() -> None:
    with pytest.raises(ScenarioError, match="--language 'de' is unknown; choose en or fr"):
        language_of("de")
