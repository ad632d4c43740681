"""Write the limits of bundled tracks again: ``python -m race_server.scenario.raceline.export``."""

from collections.abc import Iterator

from race_server.core.vehicle_presets import KART_30, KART_60, TT02, TT02_FACTS
from race_server.core.vehicles import Vehicle
from race_server.scenario.raceline.bounds import bounds_of
from race_server.scenario.raceline.bundled import limits_folder, write_bundled
from race_server.scenario.raceline.solution import solve
from race_server.scenario.track.course import Course
from race_server.scenario.track.load import own_tracks, read_course

# Tracks whose samples lie closer together [m] than this are for 1/10 cars, the others for karts.
_CLOSE = 0.2


def exports() -> Iterator[tuple[Course, Vehicle]]:
    """Yield each bundled track with each vehicle that fits its scale."""
    for path in sorted(own_tracks().glob("*.toml")):
        course = read_course(path)
        for vehicle in (TT02, TT02_FACTS) if course.spacing < _CLOSE else (KART_30, KART_60):
            yield course, vehicle


def export() -> None:
    """Solve and write every limit; remove files of earlier tracks and vehicles."""
    before = set(limits_folder().glob("*.npz"))
    written = set()
    for course, vehicle in exports():
        bounds = bounds_of(vehicle)
        written.add(write_bundled(course, bounds, solve(course, bounds)))
    for path in before - written:
        path.unlink()


if __name__ == "__main__":
    export()
