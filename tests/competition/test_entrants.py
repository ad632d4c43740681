"""Names and numbers that are kept over events."""

from pathlib import Path

import pytest
from typer.testing import CliRunner

from race_server.cli.main import app
from race_server.competition.entrants import known_entrants, read_entrants, write_entrants
from race_server.errors import ScenarioError


def faults_of(path: Path, *rows: str) -> tuple[str, ...]:
    path.write_text("\n".join(("number,name", *rows)))
    return read_entrants(path, {"Anna": 7}).faults


def test_a_name_keeps_its_number_and_a_new_one_gets_the_lowest_that_is_free(tmp_path: Path) -> None:
    path = tmp_path / "new.csv"
    path.write_text("\ufeffname,number,club\nAnna,,A\nBert,2,B\nCarl,,\n", encoding="utf-8")
    found = read_entrants(path, {"Anna": 1})
    assert found.entrants == {"Anna": 1, "Bert": 2, "Carl": 3}
    assert (found.added, found.faults) == (2, ())
    write_entrants(tmp_path / "kept.csv", found.entrants)
    assert known_entrants(tmp_path / "kept.csv") == found.entrants


def test_a_name_that_is_a_formula_is_kept_as_text_and_comes_back(tmp_path: Path) -> None:
    path = tmp_path / "kept.csv"
    entrants = {"=1+1": 1, "'=1+1": 2, "@Bert": 3, "O'Neil": 4}
    write_entrants(path, entrants)
    assert path.read_text() == "number,name\n1,'=1+1\n2,''=1+1\n3,'@Bert\n4,O'Neil\n"
    assert known_entrants(path) == entrants
    path.write_text("number,name\n1,=1+1\n")  # as before
    assert known_entrants(path) == {"=1+1": 1}


def test_a_name_for_which_no_number_is_free_is_a_wrong_row(tmp_path: Path) -> None:
    rows = [f",{number}th" for number in range(9998)]  # and Anna is known
    assert faults_of(tmp_path / "new.csv", *rows) == ()
    assert faults_of(tmp_path / "new.csv", *rows, ",Bert", ",Carl") == (
        "row 10000: no number is free for Bert; take out drivers who left",
        "row 10001: no number is free for Carl; take out drivers who left",
    )


def test_each_wrong_row_is_named_with_the_way_out(tmp_path: Path) -> None:
    assert faults_of(
        tmp_path / "new.csv", "8,Anna", "7,Bert", "x,Carl", "0,Dora", "3,", "4,Emil", "5,Emil"
    ) == (
        "row 2: Anna has number 7 already, not 8; leave its number out",
        "row 3: number 7 of Bert is that of Anna; choose another, or leave it out",
        "row 4: number 'x' of Carl: give a whole number from 1 to 9999",
        "row 5: number '0' of Dora: give a whole number from 1 to 9999",
        "row 6: name '': give 1 to 32 printable characters",
        "row 8: name 'Emil' stands in row 7 already; take one of the two out",
    )
    (fault,) = faults_of(tmp_path / "new.csv", "8,Anna\u3164")
    assert "has U+3164, which cannot be seen: give 1 to 32 printable characters" in fault


def test_a_number_of_thousands_of_digits_is_a_wrong_row(tmp_path: Path) -> None:
    (fault,) = faults_of(tmp_path / "new.csv", f"{'9' * 5000},Bert", "0008,Carl")
    shown = "9" * 20
    assert fault == f"row 2: number '{shown}' of Bert: give a whole number from 1 to 9999"


def test_a_table_without_the_columns_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "new.csv"
    path.write_text("nr;name\n1;Anna\n")
    with pytest.raises(ScenarioError, match="has nr, name: it must name the columns number and"):
        read_entrants(path, {})
    path.write_text('number,name\n1,Anna\n2,"Bert\n')
    with pytest.raises(ScenarioError, match="no CSV after line 2: unexpected end of data"):
        read_entrants(path, {})


@pytest.mark.parametrize(
    "text",
    [
        "number;name\r\n1;Anna\r\n2;Bert\r\n;;\r\n",  # as spreadsheets write it in Europe
        "Number\t Name\n1\tAnna\n2\tBert\n",
        "name\nAnna\n\n\nBert\n",
        "number,name,club\n1,Anna\n2,Bert,B,\n,,\n",
        "name;\nAnna;\nBert;\n",
    ],
)
def test_a_table_of_any_spreadsheet_is_read(text: str, tmp_path: Path) -> None:
    path = tmp_path / "new.csv"
    path.write_text(text)
    found = read_entrants(path, {})
    assert (found.entrants, found.faults) == ({"Anna": 1, "Bert": 2}, ())


def test_a_comma_within_a_name_cuts_nothing_off_in_silence(tmp_path: Path) -> None:
    path = tmp_path / "new.csv"
    path.write_text('name\n"Smith, Bob"\nMeier, Eva\n')
    found = read_entrants(path, {})
    assert found.entrants == {"Smith, Bob": 1}
    assert found.faults == ("row 3: more cells than the first row: put a name in quotation marks",)


def test_a_wrong_row_is_found_by_its_line_in_the_file(tmp_path: Path) -> None:
    assert faults_of(tmp_path / "new.csv", "1,Bert", "", "", f"5,{'x' * 300}") == (
        f"row 5: name '{'x' * 32}' has 300 characters: give 1 to 32 printable characters",
    )


def test_the_command_takes_over_all_rows_or_none(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    kept, new = tmp_path / "kept.csv", tmp_path / "new.csv"
    monkeypatch.setenv("RACE_SERVER_ENTRANTS", str(kept))
    new.write_text("number,name\n1,Anna\nx,Bert\n")
    refused = CliRunner().invoke(app, ["entrants", "import", str(new)])
    assert refused.exit_code == 2
    assert "row 3: number 'x' of Bert" in refused.output
    assert not kept.exists()
    new.write_text("number,name\n1,Anna\n2,Bert\n")
    assert CliRunner().invoke(app, ["entrants", "import", str(new)]).exit_code == 0
    assert known_entrants(kept) == {"Anna": 1, "Bert": 2}
