"""A reproduction as text: a page in Markdown, and cells for a table on the terminal."""

from collections.abc import Sequence

from race_agents.reproductions.plan import Column, Reproduction, TrainingScale
from race_agents.reproductions.summary import VariantSummary, remarks_on

NOTHING = "–"
BOUNDS_WORDS = (
    "In square brackets: the interval of 95 % (Wilson) over all starts of all runs. It says how "
    "exactly the exam knows these runs, not how far others would differ."
)


def heads_of(plan: Reproduction) -> list[str]:
    """Return the heads of all columns: what differs, theirs, ours."""
    theirs = [f"theirs: {head}" for head in plan.their_heads]
    return ["setting", *theirs, *(f"ours: {column.head}" for column in plan.columns), "ours: runs"]


def texts_of(
    plan: Reproduction, line: VariantSummary, base: VariantSummary | None, wanted: int
) -> list[str]:
    """Return the texts of a line, one for each head.

    base: the line that differences are given to; wanted: number of runs for the mean.
    """
    theirs = line.row.theirs or (NOTHING,) * len(plan.their_heads)
    ours = [_figure(column, line, base) for column in plan.columns]
    runs = f"{line.runs}" if line.runs == wanted else f"{line.runs} of {wanted}"
    return [line.row.name, *theirs, *ours, runs]


def base_of(plan: Reproduction, lines: Sequence[VariantSummary]) -> VariantSummary | None:
    """Return the line that the others are compared with, if there is one."""
    return next((line for line in lines if line.row.name == plan.base), None)


def _figure(column: Column, line: VariantSummary, base: VariantSummary | None) -> str:
    value = line.number(column)
    if value is None:
        return NOTHING
    text = f"{value:.{column.digits}f}"
    if line.runs > 1:
        text += f" ± {line.spread(column):.{column.digits}f}"
    if (bounds := line.bounds(column)) is not None:
        text += f" [{bounds[0]:.{column.digits}f}, {bounds[1]:.{column.digits}f}]"
    first = base.number(column) if base is not None and base is not line else None
    return text if first is None else f"{text} ({value - first:+.{column.digits}f})"


def scale_words(scale: TrainingScale, lines: Sequence[VariantSummary], *, quick: bool) -> str:
    """Return a text on the amount of training."""
    runs = [line.runs for line in lines] or [scale.seeds]
    count = "1 run" if max(runs) == 1 else f"mean ± deviation of {_range(runs)} runs"
    words = f"{_range([line.steps for line in lines] or [scale.steps])} decisions, {count}"
    return f"QUICK: {words}; too few to judge by" if quick else words


def _range(numbers: Sequence[int]) -> str:
    least, most = min(numbers), max(numbers)
    return f"{most}" if least == most else f"{least} to {most}"


def partial_words(plan: Reproduction, scale: TrainingScale, lines: Sequence[VariantSummary]) -> str:
    """Return a sentence on missing runs, "" if there are none."""
    runs, wanted = sum(line.runs for line in lines), plan.runs_wanted(scale)
    if runs == wanted:
        return ""
    known = {line.row.name for line in lines}
    none = [row.name for row in plan.rows if row.name not in known]
    words = f"So far {runs} of {wanted} runs are there; a row says of how many it is the mean"
    return f"{words}; none of: {'; '.join(none)}." if none else f"{words}."


def page(
    plan: Reproduction,
    scale: TrainingScale,
    lines: Sequence[VariantSummary],
    words: dict[str, str],
    *,
    quick: bool,
) -> str:
    """Return the page. words: facts to end with, such as the command and the versions."""
    base = base_of(plan, lines)
    rows = [
        heads_of(plan),
        *(texts_of(plan, line, base, plan.runs_of(line.row, scale)) for line in lines),
    ]
    table = ["| " + " | ".join(row) + " |" for row in rows]
    table.insert(1, "|" + "---|" * len(rows[0]))
    parts = [
        f"# {plan.title}",
        f"Theirs: {plan.source}.",
        f"Ours: {scale_words(scale, lines, quick=quick)}; {plan.exam.words(scale)}.",
        partial_words(plan, scale, lines),
        "\n".join(table),
        *(["In brackets: the difference to the base."] if base is not None else []),
        *(
            [BOUNDS_WORDS]
            if any(column.of and column.has_bounds for column in plan.columns)
            else []
        ),
        "\n".join(remarks_on(plan, lines)),
        "What is assumed, and what differs:",
        "\n".join(f"- {assumption}" for assumption in plan.assumptions),
        "\n".join(f"- {name}: {value}" for name, value in words.items()),
    ]
    return "\n\n".join(part for part in parts if part) + "\n"
