"""Which drivers the commands take for a vehicle, and how `race drivers` lists them."""

import json

import pytest
from typer.testing import CliRunner

from race_server.cli.main import app
from race_server.cli.options import drivers_for
from race_server.errors import DriverError

USUAL = ("raceline", "tentacles")


def test_without_names_the_usual_drivers_drive_that_are_made_for_the_vehicle() -> None:
    assert drivers_for("", USUAL, ["tt02"], unfit=False) == USUAL
    assert drivers_for("", USUAL, ["tt02", "kart-60"], unfit=False) == ("raceline",)


def test_a_named_driver_has_to_fit_unless_it_is_asked_for_all_the_same() -> None:
    assert drivers_for("avoider", USUAL, ["kart-60"], unfit=False) == ("avoider",)
    with pytest.raises(DriverError, match="or let it drive with --unfit"):
        drivers_for("tentacles", USUAL, ["tt02", "kart-60"], unfit=False)
    assert drivers_for("tentacles", USUAL, ["kart-60"], unfit=True) == ("tentacles",)


@pytest.mark.parametrize(
    "words",
    [
        "start --track hangar-400 --vehicle kart-60 --drivers mapper",
        "trial --track hangar-400 --vehicle kart-60 --driver mapper",
        "exam laps --vehicle kart-60 --driver mapper",
    ],
)
def test_a_race_a_trial_and_an_exam_refuse_a_driver_that_does_not_fit(words: str) -> None:
    result = CliRunner().invoke(app, words.split())
    assert str(result.exception).startswith(
        "driver mapper is made for tt02, tt02-drift, tt02-facts"
    )


def listed(*words: str) -> dict[str, dict[str, object]]:
    result = CliRunner().invoke(app, ["drivers", "--json", *words])
    assert result.exit_code == 0, result.output
    return {row["name"]: row for row in json.loads(result.output)["drivers"]}


def test_the_list_of_drivers_tells_vehicles_and_senses() -> None:
    rows = listed()
    assert rows["pure_pursuit"]["senses"] == ["map", "karts"]
    assert rows["tentacles"]["vehicles"] == ["tt02", "tt02-drift", "tt02-facts"]
    assert rows["learned"]["takes_argument"] is True


def test_the_list_for_a_kart_leaves_out_what_is_made_for_the_1_10_car() -> None:
    assert {"raceline", "learned"} <= set(listed("--vehicle", "kart-60"))
    assert "tentacles" not in listed("--vehicle", "kart-60")


def test_the_table_says_a_scale_in_one_word() -> None:
    output = CliRunner().invoke(app, ["drivers", "--vehicle", "kart-13"]).output
    assert "1/10, karts" in output
    assert "by its argument" in output
