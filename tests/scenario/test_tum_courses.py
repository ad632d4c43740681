"""Courses imported from tables of a centre line, as other programs write them."""

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from race_server.errors import TrackError
from race_server.scenario.text_files import read_text
from race_server.scenario.track.course import Course
from race_server.scenario.track.importers import import_course
from race_server.scenario.track.load import load_course, read_course

# A circle of radius 50 m; 3 m wide on the right of the line and 4 m on its left.
ANGLES = np.linspace(0.0, 2.0 * np.pi, 60, endpoint=False)
CIRCLE = [(50.0 * np.cos(a), 50.0 * np.sin(a), 3.0, 4.0) for a in ANGLES.tolist()]


def course_of(folder: Path, text: str) -> Course:
    """Return the course of a table."""
    path = folder / "circle.csv"
    path.write_bytes(text.encode())
    return import_course(path, folder / "circle.toml", title="Circle").course


def table(separator: str = ",", rows: Sequence[tuple[float, ...]] = CIRCLE) -> str:
    return "".join(separator.join(f"{value:.4f}" for value in row) + "\n" for row in rows)


@pytest.mark.parametrize(
    "text",
    [
        table(";"),
        table(" "),
        table("\t"),
        table("; ").replace(".", ","),  # decimal commas, as a German spreadsheet writes
        "x_m,y_m,w_tr_right_m,w_tr_left_m\n" + table(),
        "# of our hall\r\n\r\n" + table().replace("\n", "\r\n"),
        "\ufeff" + table(),
        "# x_m, y_m, w_tr_left_m, w_tr_right_m\n"
        + table(rows=[(x, y, left, right) for x, y, right, left in CIRCLE]),
        # As pandas writes it, and with quotes.
        ",x_m,y_m,w_tr_right_m,w_tr_left_m\n"
        + table(rows=[(float(n), *row) for n, row in enumerate(CIRCLE)]),
        re.sub(r"([^,\n]+)", r'"\1"', "x_m,y_m,w_tr_right_m,w_tr_left_m\n" + table()),
        "# s_m; x_m; y_m; width_right [m]; width_left [m]\n"
        + table(";", [(0.0, *row) for row in CIRCLE]),
    ],
)
def test_a_table_says_the_same_however_it_is_written(text: str, tmp_path: Path) -> None:
    course = course_of(tmp_path, text)
    assert course.length == pytest.approx(100.0 * np.pi, rel=0.001)
    assert course.half_widths[0] == pytest.approx((4.0, 3.0))


@pytest.mark.parametrize("off", [0.0, 1e-5, 1e-3])
def test_points_that_come_again_leave_no_kink(off: float, tmp_path: Path) -> None:
    x, y, right, left = CIRCLE[0]
    closed = [*CIRCLE[:30], *CIRCLE[29:], (x + off, y - off, right, left)]
    course = course_of(tmp_path, table(rows=closed))
    assert np.abs(course.line[:, 3]).max() == pytest.approx(1.0 / 50.0, rel=0.02)


def test_a_loop_that_is_open_is_told_with_its_gap(tmp_path: Path) -> None:
    def remark_on(rows: Sequence[tuple[float, ...]]) -> str:
        (tmp_path / "arc.csv").write_text(table(rows=rows))
        return import_course(tmp_path / "arc.csv", tmp_path / "arc.toml", title="Arc").remark

    # Half a circle of radius 50 m, and its steps of 6 degrees.
    told = remark_on(CIRCLE[:31])
    assert told.startswith("the last point is 100.00 m from the first, and others are 5.23 m apart")
    assert remark_on(CIRCLE) == remark_on(CIRCLE[:-2]) == ""


def test_a_racing_line_is_no_centre_line(tmp_path: Path) -> None:
    text = "# s_m; x_m; y_m; psi_rad; kappa_radpm; vx_mps\n1; 2; 3; 1; 1; 9\n"
    with pytest.raises(TrackError, match=r"line 1: columns s_m, x_m, .*: none for the widths to"):
        course_of(tmp_path, text)


@pytest.mark.parametrize(
    ("row", "message"),
    [
        ("0,0,0,1", "line 3: widths right, left = 0, 1: from the line to each side"),
        ("0,0,1,-0.5", "line 3: widths right, left = 1, -0.5: from"),
        ("0,0,1,1e3", "line 3: .* above 0 and up to 100 m"),
        ("350000,5300000,1,1", "line 3: x, y = 350000, 5.3e[+]06: up to 100000 m from zero"),
        ("0,0,1,nan", "line 3: width left is 'nan'; give a finite number in metres"),
    ],
)
def test_a_row_that_makes_no_course_is_named_in_the_table(
    row: str, message: str, tmp_path: Path
) -> None:
    with pytest.raises(TrackError, match=r"circle\.csv, " + message):
        course_of(tmp_path, f"# mine\n1,2,3,4\n{row}\n")
    assert not (tmp_path / "circle.toml").exists()


@pytest.mark.parametrize("name", ["piste\udce9", "clear\x1b[2J", "two\nlines"])
def test_a_table_may_have_any_name(name: str, tmp_path: Path) -> None:
    (tmp_path / f"{name}.csv").write_text(table())
    done = import_course(tmp_path / f"{name}.csv", tmp_path / "circle.toml", title=name)
    assert read_course(tmp_path / "circle.toml").digest == done.course.digest
    assert done.course.title.isprintable()


def test_a_course_whose_name_is_not_utf_8_is_refused(tmp_path: Path) -> None:
    (tmp_path / "circle.csv").write_text(table())
    with pytest.raises(TrackError, match="a course has its file's name in UTF-8; rename it"):
        import_course(tmp_path / "circle.csv", tmp_path / "piste\udce9.toml", title="Circle")


def test_a_long_name_is_cut_to_a_title(tmp_path: Path) -> None:
    course_of(tmp_path, table())
    words = (tmp_path / "circle.toml").read_text().replace('title = "Circle"\n', "")
    (tmp_path / f"{'long' * 20}.toml").write_text(words)
    assert read_course(tmp_path / f"{'long' * 20}.toml").title == "long" * 16


def test_a_mark_before_a_text_is_none_of_it(tmp_path: Path) -> None:
    (tmp_path / "t.toml").write_bytes(b"\xef\xbb\xbfform = 1")
    assert read_text(tmp_path / "t.toml", 100, TrackError) == "form = 1"


def test_a_tum_csv_becomes_a_course(tmp_path: Path) -> None:
    target = tmp_path / "circle.toml"
    course = course_of(tmp_path, "# x_m,y_m,w_tr_right_m,w_tr_left_m\n" + table())
    assert course.length == pytest.approx(100.0 * np.pi, rel=0.001)
    assert course.half_widths[0] == pytest.approx((4.0, 3.0))
    assert load_course(str(target)).digest == course.digest


@pytest.mark.parametrize("remark", ["# x and y\n", "# y, x\n", "# x, y, made by hand\n"])
def test_a_remark_of_few_words_names_no_columns(remark: str, tmp_path: Path) -> None:
    assert course_of(tmp_path, remark + table()).length == pytest.approx(100.0 * np.pi, rel=0.001)


def test_a_row_may_end_with_a_separator(tmp_path: Path) -> None:
    rows = "".join(f"{row},\n" for row in table().splitlines())
    assert course_of(tmp_path, rows).length == pytest.approx(100.0 * np.pi, rel=0.001)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("x_m,y_m\n1,2\n", "columns x_m, y_m: none for the widths to the right and left"),
        ("x,y,width\n1,2,3\n", "columns x, y, width: none for the widths"),
        ("1,2,,4\n", "line 1: width right is empty; give a finite number"),
        ("1,2,3,4\n" * 50, "1 points that are apart make no course; give 4 or more"),
    ],
)
def test_what_is_missing_in_a_table_is_named(text: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(TrackError, match=message):
        course_of(tmp_path, text)


def test_a_course_that_is_too_wide_names_its_table_and_the_place(tmp_path: Path) -> None:
    wide = "".join(f"{x},{y},60,60\n" for x, y in ((30, 0), (0, 30), (-30, 0), (0, -30)))
    with pytest.raises(
        TrackError, match=r"circle\.csv: wider .* up to 60\.00 m on the left near \("
    ):
        course_of(tmp_path, wide)


def test_a_tum_csv_with_words_names_the_line(tmp_path: Path) -> None:
    with pytest.raises(TrackError, match=r"circle\.csv, line 61: x is 'one'; give a finite"):
        course_of(tmp_path, table() + "one,two,three,four\n")
    assert not (tmp_path / "circle.toml").exists()
