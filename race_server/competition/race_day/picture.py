"""The tables of a race day as a picture."""

from dataclasses import replace
from pathlib import Path
from typing import Any

from race_server.competition.race_day.languages import language_of, translated
from race_server.competition.race_day.ledger import FinalRow, Ledger
from race_server.competition.race_day.plan import DayPlan
from race_server.competition.race_day.tables import (
    NOT_CLASSIFIED,
    DayTable,
    heading,
    subtitle,
    tables_of,
)
from race_server.errors import ScenarioError
from race_server.pictures import save
from race_server.scenario.track.course import Course
from race_server.scenario.track.draw import draw_on

SUFFIXES = (".png", ".svg", ".pdf")
# All lengths in inches; the picture is as wide as A4 and at least as high.
WIDTH, LEAST_HEIGHT = 8.27, 11.69
MARGIN, ROW, GAP = 0.5, 0.185, 0.22
HEAD, PODIUM, MAP = 1.0, 1.9, 2.35
TEXT, SMALL = 8.0, 7.0  # [pt]
_INK, _PALE, _RULE, _PAPER, _STRIPE = "#20242a", "#7a828c", "#d7dbe0", "#ffffff", "#f4f6f8"
_STEPS = {1: "#d9a521", 2: "#9aa3ad", 3: "#b5763a"}
# Where the steps of the podium stand, and how high they are.
_PODIUM = {2: (0.0, 0.72), 1: (1.0, 1.0), 3: (2.0, 0.5)}


def draw_picture(plan: DayPlan, ledger: Ledger, path: Path, language: str = "en") -> None:
    """Draw the tables of a day into a file, in a language.

    Raises:
        ScenarioError: the file cannot be written.
    """
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    say = language_of(language)
    *stages, final = (translated(table, say) for table in tables_of(plan, ledger))
    maps = courses_of(plan, ledger)
    tables = sum(_height(table) for table in stages)
    top = HEAD + GAP + max(PODIUM, _height(final)) + GAP
    height = max(top + MAP + GAP + tables + MARGIN, LEAST_HEIGHT)
    figure = pyplot.figure(figsize=(WIDTH, height), facecolor=_PAPER)
    page = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    page.set_xlim(0.0, WIDTH)
    page.set_ylim(height, 0.0)
    page.axis("off")
    _draw_head(page, say(heading(plan)), say(subtitle(plan)))
    _draw_podium(page, ledger.classification(), HEAD + GAP)
    _draw_table(page, final, 3.55, HEAD + GAP, WIDTH - MARGIN)
    _draw_maps(figure, page, maps, top, height)
    y = top + MAP + GAP
    for table in stages:
        y = _draw_table(page, table, MARGIN, y, WIDTH - MARGIN)
    try:
        # Without the salt, the ids in an SVG file are random.
        with pyplot.rc_context({"svg.hashsalt": plan.session}):
            save(figure, path, dpi=150, metadata=_undated(path))
    except OSError as error:
        raise ScenarioError(f"{path}: cannot be written: {error.strerror}") from error
    finally:
        pyplot.close(figure)


def courses_of(plan: DayPlan, ledger: Ledger) -> list[tuple[str, Course]]:
    """Return the courses of the day under their letters, with obstacles where there were any."""
    shown = dict(plan.courses)
    for trial in ledger.trials():
        if trial.course.obstacles:
            shown[trial.stage.track] = trial.course
    # Item boxes of the track's file are not in play.
    return [(key, replace(shown[key], spots=shown[key].spots[:0])) for key in sorted(shown)]


def _undated(path: Path) -> dict[str, Any]:
    """Return metadata without a date: the same day gives the same file."""
    dates = {".svg": {"Date": None}, ".pdf": {"CreationDate": None}}
    return dates.get(path.suffix.lower(), {})


def _draw_head(page: Any, title: str, more: str) -> None:
    page.fill([0, WIDTH, WIDTH, 0], [0, 0, HEAD, HEAD], color=_INK)
    squares = 0.09
    for column in range(round(WIDTH / squares) + 1):
        for row in range(2):
            if (column + row) % 2 == 0:
                x, y = column * squares, HEAD - (row + 1) * squares
                page.fill(
                    [x, x + squares, x + squares, x], [y, y, y + squares, y + squares], color=_PAPER
                )
    _write(page, MARGIN, 0.40, title, size=20, weight="bold", color="w")
    _write(page, MARGIN, 0.66, more, size=SMALL + 0.5, color="#c3c9d1")


def _draw_podium(page: Any, rows: list[FinalRow], top: float) -> None:
    width, floor = 0.92, top + PODIUM
    for row in rows:
        if row.place not in _PODIUM:
            continue
        column, share = _PODIUM[row.place]
        x, y = MARGIN + column * width, floor - share * 1.25
        right = x + width - 0.04
        page.fill([x, right, right, x], [floor, floor, y, y], color=_STEPS[row.place])
        middle = 0.5 * (x + right)
        number = {"size": 22, "weight": "bold", "color": "w", "ha": "center"}
        _write(page, middle, y + 0.40, str(row.place), **number)
        name = {"size": TEXT, "weight": "bold", "color": _INK, "ha": "center"}
        _write(page, middle, y - 0.08, _cut(row.team, width, TEXT, bold=True), **name)


def _draw_maps(
    figure: Any, page: Any, maps: list[tuple[str, Course]], top: float, height: float
) -> None:
    width = (WIDTH - 2.0 * MARGIN) / max(len(maps), 1)
    for number, (letter, course) in enumerate(maps):
        left = MARGIN + number * width
        box = (
            left / WIDTH,
            1.0 - (top + MAP) / height,
            0.94 * width / WIDTH,
            (MAP - 0.25) / height,
        )
        axes = figure.add_axes(box)
        draw_on(axes, course)
        axes.set_anchor("SW")
        axes.set_xticks([])
        axes.set_yticks([])
        boxes = len(course.obstacles)
        axes.set_title("", loc="left")
        figures = f"{course.length:.1f} m" + (f", {boxes} obstacles" if boxes else "")
        name = _cut(course.title, 0.9 * width, TEXT, bold=True)
        _write(page, left, top + 0.05, f"{letter}  {name}", size=TEXT, weight="bold", color=_INK)
        _write(page, left, top + 0.20, figures, size=SMALL, color=_PALE)


def _height(table: DayTable) -> float:
    return (len(table.rows) + 2.3) * ROW + GAP


def _draw_table(page: Any, table: DayTable, left: float, top: float, right: float) -> float:
    """Draw a table and return where the next one begins."""
    _write(page, left, top + 0.8 * ROW, table.title, size=TEXT + 1.5, weight="bold", color=_INK)
    widths = _column_widths(table, right - left)
    y = top + 2.1 * ROW
    _draw_row(page, table, table.heads, left, y, widths, is_head=True)
    page.plot([left, right], [y + 0.3 * ROW] * 2, color=_INK, linewidth=0.8)
    for number, row in enumerate(table.rows):
        y += ROW
        if number % 2:
            ends = [y - 0.7 * ROW] * 2 + [y + 0.3 * ROW] * 2
            page.fill([left, right, right, left], ends, color=_STRIPE, zorder=0)
        _draw_row(page, table, row, left, y, widths, is_head=False)
    page.plot([left, right], [y + 0.3 * ROW] * 2, color=_RULE, linewidth=0.6)
    return top + _height(table)


def _column_widths(table: DayTable, room: float) -> list[float]:
    """Return the widths [in] of the columns; remarks, or the space behind, take the rest.

    Without a rest, columns of text get less room, and their texts are cut.
    """
    widths = []
    for index, column in enumerate(table.heads):
        cells = [column, *(row[index] for row in table.rows)]
        widths.append(max(_measure(cell, TEXT, bold=True) for cell in cells) + 0.14)
    if "remarks" in table.columns:
        place = table.columns.index("remarks")
        widths[place] = room - sum(widths) + widths[place]
    elif (excess := sum(widths) - room) > 0.0:
        wordy = [index for index, column in enumerate(table.columns) if column in table.words]
        for index in wordy:
            widths[index] -= excess / len(wordy)
    return widths


def _draw_row(
    page: Any,
    table: DayTable,
    cells: tuple[str, ...],
    left: float,
    y: float,
    widths: list[float],
    *,
    is_head: bool,
) -> None:
    is_out = cells[0] == NOT_CLASSIFIED
    x = left
    for index, (column, cell, width) in enumerate(zip(table.columns, cells, widths, strict=True)):
        is_words = column in table.words
        is_remark = column == "remarks"
        size = SMALL if is_remark or is_head else TEXT
        color = _PALE if is_head or is_remark or is_out else _INK
        weight = "bold" if not is_head and (column == "team" or index == 0) else "normal"
        words = _cut(cell, width - 0.1, size, bold=weight == "bold") if is_words else cell
        place = x + 0.06 if is_words else x + width - 0.08
        align = "left" if is_words else "right"
        _write(page, place, y, words, size=size, weight=weight, color=color, ha=align)
        x += width


def _write(page: Any, x: float, y: float, words: str, **style: Any) -> None:
    page.text(x, y, words, **style)


def _measure(words: str, size: float, *, bold: bool = False) -> float:
    """Return the width [in] of a text in the font of the picture."""
    from matplotlib.font_manager import FontProperties
    from matplotlib.textpath import TextPath

    if not words.strip():
        return 0.0
    font = FontProperties(weight="bold" if bold else "normal")
    path = TextPath((0, 0), words.replace("$", "S"), size=size, prop=font)
    return float(path.get_extents().x1) / 72.0


def _cut(words: str, room: float, size: float, *, bold: bool = False) -> str:
    """Return as much of a text as fits into `room` [in]."""
    if _measure(words, size, bold=bold) <= room:
        return words
    while words and _measure(words + "…", size, bold=bold) > room:
        words = words[:-1]
    return words.rstrip() + "…"
