"""`race policy`: list policies, verify one, and join two."""

from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.table import Table

from race_agents.policies.registry import policy_path
from race_server.cli.document import AsJson, print_document
from race_server.errors import ScenarioError
from race_server.kept_file import check_place
from race_server.terminal import Console

app = typer.Typer(help="List learned policies, verify one, and join two.")

UNKNOWN = "–"
# They lie in memory: a kilobyte each.
MOST_OBSERVATIONS = 1_000_000
# Metadata beside the observations, with units.
FACTS = {
    **dict.fromkeys(
        ("action", "base", "scan_limit", "evades", "charts", "vehicle", "more_vehicles"), ""
    ),
    "lidar_rays": "",
    "lidar_field": " rad",
    "lidar_reach": " m",
    "decision_s": " s",
    **dict.fromkeys(
        ("algorithm", "tracks", "lots", "level", "seed", "settings", "simulator", "version"), ""
    ),
}


@app.command()
def check(
    policy: Annotated[
        str, typer.Argument(help="Name of a run or of a bundled policy, or an .onnx file.")
    ],
    observations: Annotated[
        int,
        typer.Option(
            min=1,
            max=MOST_OBSERVATIONS,
            help="Number of observations to compare, from the tracks of the set unseen (longer "
            "vehicles: unseen-kart), or from lots.",
        ),
    ] = 10_000,
    example: Annotated[
        Path | None,
        typer.Option(
            help="Write one observation to this text file, in the format of examples/policy_cpp."
        ),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Compare a policy file with its learner, time its decisions, and show its metadata.

    Exit code 1 if the two differ.
    """
    from race_agents.policies.session import Policy
    from race_agents.policies.verification import MOST_DIFFERENCE, observations_of, times_of

    path = policy_path(policy)
    if example is not None:
        check_place(example)
    loaded = Policy(path)
    seen = observations_of(loaded, observations)
    difference, remark = _difference(path, loaded, seen)
    document = {
        "file": str(path),
        "bytes": path.stat().st_size,
        "observations": len(seen),
        "decision_us": asdict(times_of(loaded, seen)),
        "difference": difference,
        "remark": remark,
        "most_difference": MOST_DIFFERENCE,
        "ok": difference is None or difference <= MOST_DIFFERENCE,
        "metadata": asdict(loaded.metadata),
        "example": _example(example, loaded, seen) if example else None,
    }
    if as_json:
        print_document(document)
    else:
        _show(document)
    if not document["ok"]:
        raise typer.Exit(1)


@app.command()
def join(
    first: Annotated[str, typer.Argument(help="Policy that drives to the slot, or by the lidar.")],
    second: Annotated[
        str, typer.Argument(help="Policy that drives into the slot, or on the line.")
    ],
    out: Annotated[Path, typer.Option(help="The .onnx file to write.")],
    within: Annotated[
        float | None,
        typer.Option(
            min=0.0, help="Distance to the slot up to which SECOND drives [m]; for parking."
        ),
    ] = None,
) -> None:
    """Write two policies as one.

    Of two that park SECOND drives within a distance of the slot. Of two that race SECOND drives
    once the kart has charted its course, in its first lap.
    """
    try:
        from race_agents.training.policy_pair import join_by_chart, join_in_lot
    except ImportError as error:
        raise ScenarioError(
            f"{error.name} is not installed: `pip install race-server[train]` installs it"
        ) from error

    one, other = policy_path(first), policy_path(second)
    try:
        if within is None:
            join_by_chart(out, one, other)
        else:
            join_in_lot(out, one, other, within)
    except OSError as error:
        raise ScenarioError(f"{out}: cannot be written: {error.strerror}") from error
    Console(soft_wrap=True).print(f"{out}, {out.stat().st_size / 1e3:.1f} kB", markup=False)


def _difference(path: Path, loaded: Any, seen: Any) -> tuple[float | None, str]:
    """Return the largest difference to the learner, or why there is none to compare with."""
    from race_agents.policies.registry import BEST, CONFIG, name_of

    run = path.parent
    if not ((run / CONFIG).is_file() and (run / BEST).is_file()):
        return None, f"not compared with its learner: {run} is no folder of a run"
    try:
        from race_agents.training.folder import settings_in
        from race_agents.training.parity import difference_in
        from race_agents.training.resumption import has_gone_on
    except ImportError as error:
        return None, (
            f"not compared with its learner: {error.name} is not installed, "
            "`pip install race-server[train]` installs it"
        )
    if has_gone_on(run, settings_in(run)):
        return None, (
            "not compared with its learner, which has learned since this file was written; "
            f"`race train --resume {name_of(run)}` writes a new one"
        )
    return difference_in(run, loaded, seen), ""


def _example(path: Path, loaded: Any, seen: Any) -> dict[str, Any]:
    """Write the last observation as text, one number per line; return the policy's answer."""
    row = seen[-1:]
    text = "".join(f"{value:.9g}\n" for value in row[0].tolist())
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise ScenarioError(f"{path}: cannot be written: {error.strerror}") from error
    return {"file": str(path), "action": loaded.decide(row)[0].tolist()}


def _show(document: dict[str, Any]) -> None:
    console = Console(soft_wrap=True)
    facts = Table("", "", show_header=False, box=None)
    times, metadata = document["decision_us"], document["metadata"]
    rows = {
        "file": f"{document['file']}, {document['bytes'] / 1e3:.1f} kB",
        "one decision": f"{times['median']:.0f} µs, 99 of 100 within {times['p99']:.0f} µs, "
        "one at a time on one thread",
        "observations": f"{document['observations']} of "
        + ("lots under unseen seeds" if metadata["lots"] else _set_of(metadata)),
        "sees": _parts(metadata),
        **{
            name.removesuffix("_s").replace("_", " "): _fact(metadata[name]) + unit
            for name, unit in FACTS.items()
        },
    }
    if document["example"]:
        rows["example"] = f"{document['example']['file']}, answered by " + ", ".join(
            f"{value:.9g}" for value in document["example"]["action"]
        )
    for name, value in rows.items():
        facts.add_row(name, value)
    console.print(facts)
    if document["difference"] is None:
        console.print(document["remark"], style="yellow")
        return
    words = f"answers like its learner up to {document['difference']:.1e}"
    limit = f"at most {document['most_difference']:g} is rounding"
    if document["ok"]:
        console.print(f"{words}; {limit}")
    else:
        console.print(f"{words}, {limit}: export it again", style="red")


def _set_of(metadata: dict[str, Any]) -> str:
    from race_agents.policies.verification import set_for

    return f"the tracks of the set {set_for(metadata['vehicle'])}"


def _parts(metadata: dict[str, Any]) -> str:
    pairs = zip(metadata["parts"], metadata["sizes"], strict=True)
    return ", ".join(part if size == 1 else f"{part} ({size})" for part, size in pairs)


def _fact(value: Any) -> str:
    if isinstance(value, tuple | list):
        return ", ".join(value) or UNKNOWN
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:g}" if isinstance(value, float) else str(value) or UNKNOWN


@app.command("list")
def list_policies(as_json: AsJson = False) -> None:
    """List the bundled policies and those of your runs, with their figures on unseen tracks."""
    from race_agents.policies.listing import entries

    known = entries()
    if as_json:
        print_document([asdict(one) for one in known])
        return
    if not known:
        Console().print("no policies so far: `race train time-trial` makes one")
        return
    table = Table(box=None, padding=(0, 1, 0, 0))
    table.add_column("policy", no_wrap=True)
    for head in ("preset", "vehicle", "by", "tracks or lots", "how well"):
        table.add_column(head, overflow="fold")
    console = Console()
    for one in known:
        preset = one.preset if one.is_run else "bundled"
        facts = (
            preset,
            ", ".join((one.vehicle, *one.more_vehicles)),
            one.algorithm,
            _tracks(one.lots or one.tracks),
        )
        table.add_row(one.name, *facts, _figures(one.evaluation))
    console.print(table)
    for one in known:
        if one.remark:
            console.print(one.remark, style="yellow", soft_wrap=True)


def _figures(evaluation: dict[str, Any]) -> str:
    """Return the figures of a policy on unseen courses, or under unseen seeds in lots."""
    if not evaluation:
        return UNKNOWN
    if "success_rate" in evaluation:
        parked, aligned = evaluation["success_rate"], evaluation["aligned_rate"]
        return f"{100.0 * parked:.1f} % park, {100.0 * aligned:.1f} % aligned"
    lap = evaluation["best_lap_s"]
    words = "no lap" if lap is None else f"best lap {lap:.2f} s"
    return f"{evaluation['speed']:.2f} m/s, {100.0 * evaluation['crash_rate']:.0f} % crash, {words}"


def _tracks(names: tuple[str, ...]) -> str:
    """Return the tracks on which a policy learned, as a set if they are one."""
    from race_server.scenario.track.sets import set_named, track_sets

    for name in track_sets():
        if tuple(set_named(name)) == names:
            return f"set {name} ({len(names)})"
    words = ", ".join(names[:2])
    return words if len(names) <= 2 else f"{words} and {len(names) - 2} more"
