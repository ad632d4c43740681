"""What `race serve --format` serves: an event, checked before anyone waits for it."""

from dataclasses import replace
from typing import TYPE_CHECKING

from race_server.cli.options import names_in
from race_server.cli.serve_options import ServeOptions
from race_server.errors import ScenarioError

if TYPE_CHECKING:
    from race_server.competition.event_spec import EventSpec
    from race_server.competition.race_day.formats import Format
    from race_server.scenario.race import Scenario

# Courses for tracks A, B and C, where a format needs more than one.
TRACKS = "covapsy-base,covapsy-train-2023,covapsy-test-2023"


def event_of(options: ServeOptions, *, needs_line: bool) -> "tuple[EventSpec, Scenario]":
    """Return the event, and what stands in the world until its first race.

    needs_line: a driver of the server observes the reference line.

    Raises:
        ScenarioError: an option is wrong, or the event cannot be driven on all seats.
    """
    from race_server.competition.entrants import default_path, known_entrants
    from race_server.competition.event_spec import EventSpec, waiting_scenario
    from race_server.competition.race_day.formats import format_named
    from race_server.competition.race_day.plan import DayPlan, teams_of
    from race_server.core.vehicle_presets import vehicle_named
    from race_server.scenario.track.load import load_course
    from race_server.storage.recording.logbook import folder_of

    if options.lot:
        raise ScenarioError("--format and --lot: an event is raced, leave one of them out")
    folder = folder_of(options.record)
    if folder is None:
        raise ScenarioError(
            "--format with --record none: an event is kept beside its recordings, so that it goes "
            "on after a stop; name a folder"
        )
    form = _adapted(format_named(options.format), options)
    tracks = tracks_for(form, options.tracks or _usual_tracks(form, options.track))
    courses = {letter: load_course(name) for letter, name in tracks.items()}
    teams = teams_of(["driver"] * options.karts)
    plan = DayPlan(form, teams, courses, vehicle_named(options.car), options.seed, needs_line)
    plan.check()
    spec = EventSpec(
        format=form,
        tracks=tracks,
        vehicle=options.car,
        seed=options.seed,
        folder=folder,
        call_s=options.call_limit,
        cool_down_s=options.cool_down,
        review_s=options.review,
        needs_line=needs_line,
        numbers=known_entrants(default_path()),
    )
    return spec, replace(waiting_scenario(plan, options.karts), seed=options.seed)


def _adapted(form: "Format", options: ServeOptions) -> "Format":
    """Return a format with what the options say of its time trials by laps.

    Raises:
        ScenarioError: it has none, and they say something, or more than a format may.
    """
    from race_server.competition.race_day.formats import LAP, TimeTrial
    from race_server.competition.race_day.formats.reader import MOST_LAPS
    from race_server.competition.time_trial.run_spec import STARTS

    if options.start not in {"", *STARTS}:
        raise ScenarioError(f"--start {options.start}: choose {' or '.join(STARTS)}")
    by_lap = [s for s in form.stages if isinstance(s, TimeTrial) and s.counts == LAP]
    if (options.attempts or options.start or options.attempt_limit) and not by_lap:
        raise ScenarioError(
            f"--attempts, --start and --attempt-limit are for time trials in which the best lap "
            f"counts; format {form.name} has none, change them in a .toml file of yours"
        )
    is_own = options.format.endswith(".toml")  # it says how many laps
    if by_lap and not is_own and options.laps > MOST_LAPS:
        raise ScenarioError(
            f"--laps {options.laps}: an attempt has {MOST_LAPS} laps at most; choose fewer"
        )
    if 0.0 < options.attempt_limit < 1.0:
        raise ScenarioError(
            f"--attempt-limit {options.attempt_limit:g}: give 1 second or more, or 0 for as many "
            "as the format says"
        )
    stages = tuple(
        replace(
            stage,
            laps=stage.laps if is_own else options.laps,
            attempts=options.attempts or stage.attempts,
            start=options.start or stage.start,
            failure_s=options.attempt_limit or stage.failure_s,
        )
        if isinstance(stage, TimeTrial) and stage in by_lap
        else stage
        for stage in form.stages
    )
    return replace(form, stages=stages)


def _usual_tracks(form: "Format", track: str) -> str:
    return track if len(form.letters) == 1 else TRACKS


def tracks_for(form: "Format", tracks: str) -> dict[str, str]:
    """Return the track of each letter that a format needs.

    Raises:
        ScenarioError: there are fewer tracks than the format needs.
    """
    names = names_in(tracks)
    places = ["ABCDEFGHIJ".index(letter) for letter in form.letters]
    if places and max(places) >= len(names):
        raise ScenarioError(
            f"--tracks names {len(names)}: format {form.name} needs "
            f"{max(places) + 1}, for tracks {', '.join(form.letters)}"
        )
    return {letter: names[place] for letter, place in zip(form.letters, places, strict=True)}
