"""A picture of an exam of races: ratings with their bounds, and who came home."""

from collections.abc import Sequence
from pathlib import Path

from race_server.competition.race_exam import RaceRow
from race_server.pictures import save_and_close
from race_server.storage.results.ratings import INTERVAL

_INK, _BLUE = "#20242a", "#1565c0"
_DOT = 3.0  # [pt]; smaller than the bounds about it
_WIDTH, _HEIGHT = 10.0, 0.55  # [in]; of a driver


def draw_ratings(rows: Sequence[RaceRow], path: Path) -> None:
    """Draw the drivers below each other, the strongest first: ratings, mean places, finishes.

    Raises:
        ScenarioError: the file cannot be written.
    """
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    size = (_WIDTH, 1.4 + _HEIGHT * len(rows))
    figure, panels = pyplot.subplots(1, 3, figsize=size, sharey=True, layout="constrained")
    ratings, places, finishes = panels
    for height, row in enumerate(rows):
        ratings.plot(row.rating_interval, (height, height), color=_INK, linewidth=1.2)
        ratings.plot(row.rating, height, "o", color=_BLUE, markersize=_DOT)
        spread = INTERVAL * row.place_error
        ends = (row.mean_place - spread, row.mean_place + spread)
        places.plot(ends, (height, height), color=_INK, linewidth=1.2)
        places.plot(row.mean_place, height, "o", color=_BLUE, markersize=_DOT)
        share, (low, high) = 100.0 * row.finish_rate, row.finish_interval
        finishes.barh(height, share, height=0.6, color=_BLUE, alpha=0.35)
        finishes.plot((100.0 * low, 100.0 * high), (height, height), color=_INK, linewidth=1.2)
    ratings.set_yticks(range(len(rows)), [row.driver for row in rows])
    ratings.set_ylim(len(rows) - 0.5, -0.5)
    ratings.set_xlabel("rating, with bounds of 95 %")
    places.set_xlabel("mean place, with bounds of 95 %")
    finishes.set_xlim(0.0, 100.0)
    finishes.set_xlabel("finished [%], with bounds of 95 %")
    for panel in panels:
        panel.tick_params(labelsize=8)
        panel.grid(axis="x", alpha=0.25)
        for side in ("top", "right"):
            panel.spines[side].set_visible(False)
    save_and_close(figure, path, dpi=150, facecolor="white")
