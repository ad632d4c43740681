"""`race exam retention`: what is left of help when it is gone."""

from typing import Annotated, Any, Literal

import typer
from rich.table import Table

from race_agents.commands.exam_watch import examined
from race_server.cli.document import AsJson
from race_server.cli.options import seeds_from
from race_server.core.seeds import HELD_OUT
from race_server.terminal import Console


def retention(
    track: Annotated[
        str, typer.Option(help="Course: a name from `race track list`.")
    ] = "hangar-400",
    vehicle: Annotated[str, typer.Option(help="Vehicle of the simulated pupils.")] = "kart-60",
    pupils: Annotated[int, typer.Option(min=2, help="Pupils, each under three ways of help.")] = 8,
    first_seed: Annotated[
        int, typer.Option(min=0, help="Seed of the first pupil; the next ones count up from it.")
    ] = HELD_OUT + 1,
    by: Annotated[
        Literal["words", "kart"],
        typer.Option(help="What helps: words, or the kart, which brakes and accelerates itself."),
    ] = "words",
    as_json: AsJson = False,
) -> None:
    """Coach simulated pupils for ten laps, and time three laps without help after them.

    Help never given, always given where there was a fault once, or withdrawn and returned by what
    the coach sees. Pupils are a model: they learn from the error that they feel, and forget.
    """
    from race_agents.pupils.retention import RetentionSpec, document_of, school_all

    spec = RetentionSpec(track, vehicle, seeds_from(first_seed, pupils), by)
    examined(lambda watch: document_of(spec, list(school_all(spec, watch))), _show, as_json=as_json)


def _show(document: dict[str, Any]) -> None:
    table = Table(
        title=f"{document['track']}, {document['vehicle']}, {document['pupils']} simulated pupils, "
        f"helped by {'words' if document['by'] == 'words' else 'the kart'}"
    )
    table.add_column("help", no_wrap=True)
    for head in (
        "alone [s]",
        "gained, median",
        "95 % of the mean",
        "in the first",
        "corners helped",
    ):
        table.add_column(head, justify="right", no_wrap=True)
    for row in document["ways"]:
        low, high = (100.0 * bound for bound in row["gain_interval"])
        table.add_row(
            row["way"],
            f"{row['alone_s']:.3f}",
            f"{100.0 * row['gain']:.0f} %",
            f"{low:.0f} to {high:.0f} %",
            f"{100.0 * row['gain_at_once']:.0f} %",
            f"{row['corners_helped']:.2f}",
        )
    console = Console()
    console.print(table)
    low, high = document["faster_alone_after_fading_interval_s"]
    console.print(
        f"alone, after help that faded, a lap is {document['faster_alone_after_fading_s']:.3f} s "
        f"faster than after help that stayed ({low:.3f} to {high:.3f} s)",
        highlight=False,
    )
