"""A reproduction as text: a page in Markdown, and cells for a table on the terminal."""

from collections.abc import Sequence

from agents.reproductions.plan import Column, Reproduction, Scale
from agents.reproductions.summary import Line, remarks_on

NOTHING = "–"


def heads_of(plan: Reproduction) -> list[str]:
    """Return the heads of all columns: what differs, theirs, ours."""
    theirs = [f"theirs: {head}" for head in plan.their_heads]
    return ["setting", *theirs, *(f"ours: {column.head}" for column in plan.columns)]


def cells_of(plan: Reproduction, line: Line, base: Line | None) -> list[str]:
    """Return the texts of a line, one for each head. base: what differences are told to."""
    theirs = line.row.theirs or (NOTHING,) * len(plan.their_heads)
    ours = [_figure(column, line, base) for column in plan.columns]
    return [line.row.name, *theirs, *ours]


def base_of(plan: Reproduction, lines: Sequence[Line]) -> Line | None:
    """Return the line that the others are compared with, if there is one."""
    return next((line for line in lines if line.row.name == plan.base), None)


def _figure(column: Column, line: Line, base: Line | None) -> str:
    value = line.number(column)
    if value is None:
        return NOTHING
    text = f"{value:.{column.digits}f}"
    if line.runs > 1:
        text += f" ± {line.spreads[column.key]:.{column.digits}f}"
    first = base.number(column) if base is not None and base is not line else None
    return text if first is None else f"{text} ({value - first:+.{column.digits}f})"


def scale_words(scale: Scale, *, quick: bool) -> str:
    """Return how much was trained."""
    runs = "1 run" if scale.seeds == 1 else f"mean ± deviation of {scale.seeds} runs"
    words = f"{scale.steps} decisions, {runs}"
    return f"QUICK: {words}; too few to judge by" if quick else words


def page(
    plan: Reproduction, scale: Scale, lines: Sequence[Line], words: dict[str, str], *, quick: bool
) -> str:
    """Return the page. words: facts to end with, such as the command and the versions."""
    base = base_of(plan, lines)
    rows = [heads_of(plan), *(cells_of(plan, line, base) for line in lines)]
    table = ["| " + " | ".join(row) + " |" for row in rows]
    table.insert(1, "|" + "---|" * len(rows[0]))
    missing = len(plan.rows) - len(lines)
    parts = [
        f"# {plan.title}",
        f"Theirs: {plan.source}.",
        f"Ours: {scale_words(scale, quick=quick)}; {plan.exam_words(scale)}.",
        *([f"{missing} of {len(plan.rows)} rows are not there yet."] if missing else []),
        "\n".join(table),
        *(["In brackets: the difference to the base."] if base is not None else []),
        "\n".join(remarks_on(plan, lines)),
        "What is assumed, and what differs:",
        "\n".join(f"- {assumption}" for assumption in plan.assumptions),
        "\n".join(f"- {name}: {value}" for name, value in words.items()),
    ]
    return "\n\n".join(part for part in parts if part) + "\n"
