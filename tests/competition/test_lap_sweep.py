"""A sweep: one thing is off, further and further, until a driver fails."""

from collections.abc import Iterator, Sequence
from typing import Any

import pytest

from race_server.competition import lap_sweep
from race_server.competition.lap_exam import CourseTry, LapExamSpec
from race_server.competition.lap_sweep import SWEEPS, SweepRow, sweep_all

MASS = next(sweep for sweep in SWEEPS if sweep.name == "more mass")


def swept(clean: dict[str, int], monkeypatch: pytest.MonkeyPatch) -> tuple[SweepRow, list[str]]:
    """Return the row of mass of a driver whose clean laps of ten are known by setting.

    Also the settings of mass that it was asked to drive.
    """
    asked: list[str] = []

    def examine(spec: LapExamSpec, drivers: Sequence[str], *_: Any) -> Iterator[CourseTry]:
        gap = spec.gaps[0].name
        asked.append(gap)
        held = clean.get(gap, 10)
        for driver in drivers:
            yield CourseTry(driver, "ring", 10, 5.0, (5.5,) * 10, held, contacts=0, rescues=0)

    monkeypatch.setattr(lap_sweep, "examine", examine)
    rows = sweep_all(LapExamSpec(("ring",)), ["ann"], {}, lambda _: None)
    found = next(row for row in rows if row.factor == MASS.name)
    return found, [gap for gap in asked if gap.startswith(MASS.name)]


def test_a_driver_that_holds_all_steps_breaks_at_none(monkeypatch: pytest.MonkeyPatch) -> None:
    row, asked = swept({}, monkeypatch)
    assert (row.held, row.broke) == (2.0, None)
    assert len(asked) == 4
    assert [one["step"] for one in row.steps] == [1.0, 1.1, 1.25, 1.5, 2.0]


def test_what_is_worse_than_a_step_that_failed_is_not_driven(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    row, asked = swept({"more mass 1.25": 8}, monkeypatch)
    assert (row.held, row.broke) == (1.1, 1.25)
    assert asked == ["more mass 1.1", "more mass 1.25"]


def test_nine_clean_laps_of_ten_hold(monkeypatch: pytest.MonkeyPatch) -> None:
    assert swept({"more mass 1.25": 9}, monkeypatch)[0].held == 2.0


def test_a_driver_that_fails_with_nothing_off_holds_no_step(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    row, asked = swept({"none": 3}, monkeypatch)
    assert (row.held, row.broke, asked) == (None, 1.0, [])


def test_each_step_changes_one_factor_alone() -> None:
    for sweep in SWEEPS:
        nominal = sweep.gap_at(sweep.steps[0])
        for step in sweep.steps[1:]:
            gap = sweep.gap_at(step)
            before, after = vars(nominal.reality), vars(gap.reality)
            off = [name for name in before if before[name] != after[name]]
            off += [
                name
                for name in ("noise", "dropouts")
                if getattr(gap, name) != getattr(nominal, name)
            ]
            assert len(off) == 1, gap.name
