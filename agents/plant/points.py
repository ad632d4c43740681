"""Points of meetings by the public calculator of Euro NCAP (extra `rating`), where it is installed.

The package euroncap-rating-2026 scores workbooks of whole cars. Its parts are used here: the cells
of a matrix from its template, the colour of each by the speed at impact, and the points of the
cells that were driven. So these are points of the shapes of a protocol, and no rating: no
laboratory drove, the vehicle is a kart, and the darkness, the robustness layers and the cells
above 60 km/h are left out.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from importlib.resources import files
from typing import Any

PACKAGE = "euroncap-rating-2026"
# The sheet of its template that holds the matrix of a meeting, and the name of the matrix there.
PEOPLE, CARS = "FC - Ped & Cyc pred.", "FC - Car & PTW pred."
MATRICES = {
    **{name: (PEOPLE, f"{name} day") for name in ("CPLA", "CPNA", "CPFA", "CPNCO")},
    **{name: (CARS, name) for name in ("CCRs", "CCRm", "CCRb")},
}

Cell = tuple[int, int]  # the kart's speed [km/h], and where it would hit [% of the width]


@dataclass(frozen=True)
class Points:
    """What the driven cells of a matrix come to, as if they were all of it."""

    standard: float
    extended: float
    most_standard: float  # what there is for each range of which a cell was driven
    most_extended: float
    cells: int  # that were driven

    @property
    def total(self) -> float:
        """Points of both ranges."""
        return self.standard + self.extended


def calculator() -> str | None:
    """Return the calculator and its version, None where it is not installed."""
    try:
        return f"{PACKAGE} {version(PACKAGE)}"
    except PackageNotFoundError:
        return None


def points_of(name: str, impacts: Mapping[Cell, float]) -> Points:
    """Return the points of a matrix. impacts: speed at impact [km/h], 0 where it was avoided."""
    from euroncap_rating_2026.crash_avoidance import data_model, matrix_processing, test_info

    _, test = MATRICES[name]
    driven = []
    for point in _cells_of(name):
        speed, where = (
            int(point.attributes[key].split()[0].rstrip("%"))
            for key in ("VUT speed", "Impact location")
        )
        impact = impacts.get((speed, where))
        # Rows of CPLA without a function may be met by a warning instead of the brakes.
        if impact is None or (name == "CPLA" and "Function" not in point.attributes):
            continue
        point.color = matrix_processing.ComputedTestPoint(point, test, impact).measured_color
        driven.append(point)
    standard, extended = test_info.compute_predicted_score(test, driven)
    most, ranges = data_model.TOTAL_SCORES[test], {each.test_range.name for each in driven}
    return Points(
        standard,
        extended,
        most["Standard"] if "STANDARD" in ranges else 0.0,
        most["Extended"] if "EXTENDED" in ranges else 0.0,
        len(driven),
    )


def _cells_of(name: str) -> list[Any]:
    """Return the cells of a matrix, of which no colour is known."""
    from euroncap_rating_2026.crash_avoidance import data_model, matrix_processing

    sheet, test = MATRICES[name]
    key = data_model.StageSubelementKey.FC
    return list(matrix_processing.get_test_matrix(_sheet(sheet), test, key))


@cache
def _sheet(name: str) -> Any:
    import pandas

    return pandas.read_excel(str(files("data").joinpath("ca_template.xlsx")), sheet_name=name)
