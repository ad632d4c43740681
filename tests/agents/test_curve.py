"""The curve of a run whose file was cut off: what is whole is kept, and the run goes on."""

from pathlib import Path

import pytest

from race_agents.training import curve

POINT = curve.Point(1.0, 300, 10.0, 1e-3, reward=2.5)


def table(path: Path) -> bytes:
    """Write rows of 100, 200 and 300 decisions; return the bytes of the file."""
    for steps in (100, 200, 300):
        curve.append(path, curve.Point(1.0, steps, 10.0, 1e-3, reward=0.5))
    return path.read_bytes()


def steps_in(path: Path) -> list[float]:
    return [row["steps"] for row in curve.read(path)]


def test_after_any_byte_that_was_the_last_the_rows_before_it_are_kept(tmp_path: Path) -> None:
    path = tmp_path / "curve.csv"
    whole = table(path)
    ends = [number + 1 for number, byte in enumerate(whole) if byte == ord("\n")]
    for size in range(len(whole) + 1):
        path.write_bytes(whole[:size])
        curve.cut(path, 300)
        rows = [100, 200, 300][: sum(end <= size for end in ends[1:])]
        assert path.is_file() == (size >= ends[0])
        if rows:
            assert steps_in(path) == rows
        curve.append(path, POINT)
        assert steps_in(path) == [*rows, 300]


def test_a_curve_that_was_cut_off_is_drawn_after_the_run_goes_on(tmp_path: Path) -> None:
    path, picture = tmp_path / "curve.csv", tmp_path / "curve.png"
    path.write_bytes(table(path)[:-12])
    curve.cut(path, 300)
    curve.append(path, POINT)
    curve.draw(path, picture, "cut off")
    assert steps_in(path) == [100, 200, 300]
    assert picture.read_bytes()[:4] == b"\x89PNG"


@pytest.mark.parametrize(
    "row", [b"1.0,150\n", b"1.0,1x0" + b"," * 18 + b"\n", b"\0" * 40 + b"\n", b"\xff\xfe\n", b"\n"]
)
def test_a_row_that_is_none_is_left_out_from_between_the_others(row: bytes, tmp_path: Path) -> None:
    path = tmp_path / "curve.csv"
    head, first, *rest = table(path).splitlines(keepends=True)
    path.write_bytes(b"".join([head, first, row, *rest]))
    curve.cut(path, 200)
    assert steps_in(path) == [100, 200]


@pytest.mark.parametrize("content", [b"", b"\0" * 500, b"\xff\xfe\xfd\n1,2\n", b"minutes,ste"])
def test_a_table_without_a_head_counts_as_none(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "curve.csv"
    path.write_bytes(content)
    curve.cut(path, 300)
    assert not path.exists()
    curve.append(path, POINT)
    assert steps_in(path) == [300]


def test_a_small_learning_rate_is_not_nothing(tmp_path: Path) -> None:
    path = tmp_path / "curve.csv"
    curve.append(path, curve.Point(1.0, 100, 10.0, 2.5e-7))
    assert curve.read(path)[0]["learning_rate"] == 2.5e-7
