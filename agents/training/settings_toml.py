"""Settings of a training from TOML and back."""

import hashlib
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any, get_args

from pydantic import ValidationError

from race_agents.training.algorithm_options import check_options
from race_agents.training.settings import LEARNER, PLANNER, Settings
from race_server.core.observation import layout_of
from race_server.core.seeds import HELD_OUT
from race_server.errors import ScenarioError
from race_server.scenario.text_files import MOST_TOML, parse_toml, read_text

ON_POLICY = ("ppo", "ppo-sb3", "mappo", "poca")
# What a policy can be measured by, under `goal`.
RACE_GOALS = {"speed", "crash_rate", "best_lap_s"}
LOT_GOALS = {"parked", "aligned", "hits"}
PRESETS = Path(__file__).parent / "presets"

Words = dict[str, Any]


def preset_names() -> list[str]:
    """Return the names of the bundled presets."""
    return sorted(path.stem for path in PRESETS.glob("*.toml"))


def read_settings(name: str, changes: Sequence[str] = ()) -> Settings:
    """Return the settings of a preset or of a .toml file.

    changes: such as ``algorithm.learning_rate=1e-3``; values are TOML, or else text;
        ``none`` removes a key.

    Raises:
        ScenarioError: a key or a value is not valid.
    """
    path = Path(name) if name.endswith(".toml") else PRESETS / f"{name}.toml"
    if not path.is_file():
        known = ", ".join(preset_names())
        raise ScenarioError(f"preset {name!r} is unknown; choose one of {known}, or a .toml file")
    try:
        words = parse_toml(read_text(path, MOST_TOML, ScenarioError))
    except ValueError as error:
        raise ScenarioError(f"{path.name}: not valid TOML: {error}") from error
    for change in changes:
        set_key(words, change)
    return settings_of(words, path.name)


def settings_of(words: Words, source: str) -> Settings:
    """Return checked settings.

    Raises:
        ScenarioError: a key or a value is not valid.
    """
    try:
        settings = Settings.model_validate(words)
    except ValidationError as error:
        raise ScenarioError(_sentence(error, source)) from None
    if (settings.minutes is None) == (settings.steps is None):
        raise ScenarioError(
            f"{source}: minutes = {settings.minutes}, steps = {settings.steps}: give one of the two"
        )
    check_options(settings.algorithm.options, source)
    _check_use(settings, source)
    _check_seats(settings, source)
    if settings.race.learners > settings.race.karts:
        raise ScenarioError(
            f"{source}: race.learners = {settings.race.learners} with race.karts = "
            f"{settings.race.karts}: give at least as many karts, or fewer learners"
        )
    _check_discipline(settings, source)
    _check_team(settings, source)
    _check_policies(settings, source)
    if settings.parks:
        _check_seeds(settings, source)
    is_discrete = settings.action == "discrete"
    takes_all = settings.algorithm.name in ON_POLICY
    if (settings.algorithm.name == "dqn") != is_discrete and not takes_all:
        raise ScenarioError(
            f"{source}: algorithm.name = {settings.algorithm.name!r} with action = "
            f"{settings.action!r}: dqn needs discrete actions, sac and td3 others, "
            "ppo and poca take all, mappo all but these"
        )
    return settings


def _check_use(settings: Settings, source: str) -> None:
    """Refuse what would show only at the end that it fits nothing."""
    seconds, decision_s = settings.evaluation.seconds, settings.decision_s
    if settings.base and settings.action != "residual":
        raise ScenarioError(
            f"{source}: base = {settings.base!r} with action = {settings.action!r}: only residual "
            "actions advise a driver; leave base out"
        )
    sees = layout_of(settings.observation, settings.lidar.rays).slices
    if settings.scan_limit and (settings.parks or settings.base or "lidar" not in sees):
        raise ScenarioError(
            f"{source}: scan_limit = {settings.scan_limit:g}: it is for policies that race by a "
            "lidar, without a base driver; leave it out"
        )
    if settings.evades and not settings.parks:
        raise ScenarioError(f"{source}: evades = true: it is for policies that park; leave it out")
    name, network = settings.algorithm.name, settings.network
    if network.products and (name not in {"ppo", "mappo"} or len(network.layers) < 2):
        raise ScenarioError(
            f"{source}: network.products = {network.products!r} with algorithm.name = {name!r}, "
            f"network.layers = {list(network.layers)}: it is for the products between two layers "
            "of ppo and mappo; leave it out"
        )
    if not settings.parks and seconds < decision_s:
        raise ScenarioError(
            f"{source}: evaluation.seconds = {seconds:g}: no decision is made in them; give "
            f"{decision_s:g} or more"
        )


def _check_seats(settings: Settings, source: str) -> None:
    seats, race = settings.self_play.seats, settings.race
    learners = seats.count(LEARNER)
    if seats and (len(seats), learners) != (race.karts, race.learners):
        raise ScenarioError(
            f"{source}: self_play.seats names {len(seats)} karts, {learners} of them learners; "
            f"race.karts = {race.karts}, race.learners = {race.learners}: make them agree"
        )


def _check_discipline(settings: Settings, source: str) -> None:
    """Refuse what only races have in a lot, and the reverse, before it is ignored."""
    parks, where = settings.parks, f"parking.lots = {list(settings.parking.lots)}"
    score, teacher = settings.evaluation.score, settings.warm_start.teacher
    goals = LOT_GOALS if parks else RACE_GOALS
    strange = sorted(set(settings.goal.model_dump(exclude_none=True)) - goals)
    wrong = {
        f"goal.{', goal.'.join(strange)}: choose {', '.join(sorted(goals))}": bool(strange),
        f"evaluation.score = {score!r}: choose success or return": parks and score == "speed",
        "evaluation.score = 'success': choose speed or return": not parks and score == "success",
        "self_play.seats: name race.opponents instead": parks and bool(settings.self_play.seats),
        f"warm_start.teacher = {teacher!r}: a driver follows a track's line; "
        f"choose {PLANNER} or demonstrations": (parks and teacher not in {"", PLANNER}),
        f"warm_start.teacher = {PLANNER!r}: choose a driver": not parks and teacher == PLANNER,
        "parking.shaping = 'hurl' and parking.heuristic = 'none': hurl needs a heuristic": (
            settings.mixes and settings.parking.heuristic == "none"
        ),
    }
    for sentence, is_wrong in wrong.items():
        if is_wrong:
            raise ScenarioError(f"{source}: with {where}, {sentence}")
    if settings.cloning.demonstrations and settings.algorithm.name not in ON_POLICY:
        raise ScenarioError(
            f"{source}: cloning with algorithm.name = {settings.algorithm.name!r}: only ppo and "
            "poca can imitate beside what they learn by reward; leave cloning.demonstrations out"
        )


def _check_team(settings: Settings, source: str) -> None:
    """Refuse what several vehicles that learn in one lot, or `poca`, cannot have."""
    name, parks, team = settings.algorithm.name, settings.parks, settings.parking.team
    is_poca, several = name == "poca", settings.race.learners > 1
    judges = bool(settings.gail.demonstrations) or settings.curiosity.bonus > 0.0 or settings.mixes
    wrong = {
        f"algorithm.name = {name!r}: only ppo and poca learn from several vehicles of a lot": parks
        and several
        and name not in ON_POLICY,
        "gail, curiosity or hurl: they would judge vehicles that wait for the others; leave them "
        "out": parks and several and judges,
        "algorithm.name = 'poca' on tracks: karts come back one by one, so that no group ends; "
        "choose ppo, or parking.lots": is_poca and several and not parks,
        "algorithm.name = 'poca' with parking.team: poca takes the mean of all rewards by itself; "
        "leave parking.team out": is_poca and team,
        f"algorithm.name = {name!r} with warm_start: its critic is of another kind than ppo's; "
        "leave warm_start out": name in {"poca", "mappo"}
        and (settings.warm_start.is_wanted or bool(settings.warm_start.policy)),
        "algorithm.name = 'mappo' in a lot: it learns as well from vehicles that wait for others; "
        "set parking.team = true, or choose poca": name == "mappo"
        and parks
        and several
        and not team,
    }
    for sentence, is_wrong in wrong.items():
        if is_wrong:
            raise ScenarioError(
                f"{source}: with race.learners = {settings.race.learners}, {sentence}"
            )


def _check_policies(settings: Settings, source: str) -> None:
    """Refuse what several policies that learn in the same races cannot have."""
    policies = settings.policies
    if not policies:
        return
    names, karts = [one.name for one in policies], sum(one.karts for one in policies)
    vehicles = {one.vehicle or settings.vehicle for one in policies}
    wrong = {
        f"race.learners = {settings.race.learners}: their karts are {karts}; make them agree": (
            settings.race.learners != karts
        ),
        "race.opponents = []: name drivers, which have the seats of the others where one policy is "
        "evaluated": len(policies) > 1 and not settings.race.opponents,
        f"names {', '.join(names)}: give each its own": len(set(names)) < len(names),
        "parking.lots: several policies learn in races alone": settings.parks,
        "self_play.seats, curriculum, gail, curiosity, warm_start or goal: leave these out": bool(
            settings.self_play.seats
            or settings.curriculum
            or settings.gail.demonstrations
            or settings.curiosity.bonus > 0.0
            or settings.warm_start.is_wanted
            or settings.warm_start.run
            or settings.warm_start.policy
            or settings.goal.model_dump(exclude_none=True)
        ),
        f"action = {settings.action!r} and the vehicles {', '.join(sorted(vehicles))}: advice is "
        "in widths of one vehicle; choose one for all": settings.action == "residual"
        and len(vehicles) > 1,
        f"algorithm.name = {settings.algorithm.name!r}: choose ppo or mappo": (
            settings.algorithm.name not in {"ppo", "ppo-sb3", "mappo"}
        ),
    }
    for sentence, is_wrong in wrong.items():
        if is_wrong:
            raise ScenarioError(f"{source}: with policies, {sentence}")


def _check_seeds(settings: Settings, source: str) -> None:
    """Refuse seeds of an evaluation or an exam: in a lot, seeds are what is held out."""
    first, tried = settings.seed, settings.evaluation
    # A teacher has as many worlds, with the seeds behind these, see `imitation.School`.
    count = settings.worlds * (2 if settings.warm_start.teacher else 1)
    whose_worlds = "its worlds and its teacher's" if count > settings.worlds else "the worlds"
    last = first + count - 1
    taken = {
        "evaluation.first_seed": (tried.first_seed, tried.first_seed + tried.seeds - 1),
        "the last evaluation": (tried.final_seed, tried.final_seed + tried.seeds - 1),
        "exams": (HELD_OUT, max(last, HELD_OUT)),
    }
    for whose, (lowest, highest) in taken.items():
        if first <= highest and last >= lowest:
            raise ScenarioError(
                f"{source}: seed = {first}, worlds = {settings.worlds}: {whose_worlds} have "
                f"the seeds {first} to {last}, and those from {lowest} on are for {whose}; choose "
                "others"
            )


def _sentence(error: ValidationError, source: str) -> str:
    first = error.errors()[0]
    key = ".".join(str(part) for part in first["loc"] if not _is_branch(part))
    value = repr(first.get("input"))[:60]
    reason = first["msg"][:1].lower() + first["msg"][1:]
    if first["type"] in {"extra_forbidden", "unexpected_keyword_argument"}:
        known = ", ".join(_keys_beside(first["loc"]))
        reason = f"no such key; known here are {known}"
    return f"{source}: {key} = {value}: {reason}"


def _is_branch(part: int | str) -> bool:
    """Return whether a step of a location is a branch of a union rather than a key."""
    return isinstance(part, str) and (part in {"str", "float"} or "[" in part)


def _keys_beside(place: tuple[int | str, ...]) -> list[str]:
    table: Any = Settings
    for key in place[:-1]:
        # A number stands for one of several tables, such as the stages of a curriculum.
        table = _fields_of(table)[key].annotation if isinstance(key, str) else get_args(table)[0]
    return sorted(_fields_of(table))


def _fields_of(table: Any) -> dict[str, Any]:
    """Return the keys of a table, or of a dataclass that stands for one."""
    fields: dict[str, Any] = getattr(table, "model_fields", None) or getattr(
        table, "__dataclass_fields__", {}
    )
    return fields


def set_key(words: Words, change: str) -> None:
    """Change one key of settings, such as ``algorithm.learning_rate=1e-3``, as `read_settings`.

    Raises:
        ScenarioError: it is no change of a key.
    """
    key, equals, value = change.partition("=")
    if not equals or not key.strip():
        raise ScenarioError(f"--set {change!r}: write key=value, such as algorithm.name=sac")
    *tables, last = key.strip().split(".")
    table = words
    for name in tables:
        table = table.setdefault(name, {})
        if not isinstance(table, dict):
            raise ScenarioError(
                f"--set {change!r}: {name} = {table!r} is no table here; give it whole, such as "
                f"--set '{name}={{{last} = {value.strip()}}}'"
            )
    if value.strip() == "none":
        table.pop(last, None)
        return
    try:
        table[last] = parse_toml(f"value = {value}")["value"]
    except ValueError:
        table[last] = value.strip()


def as_toml(settings: Settings, *, without: Sequence[str] = ()) -> str:
    """Return all settings as TOML, defaults included, but for some keys."""
    words = settings.model_dump(mode="json", exclude_none=True, exclude=set(without))
    return "\n".join([*_lines(words, ()), ""])


def _lines(words: Words, path: tuple[str, ...]) -> list[str]:
    plain = {key: value for key, value in words.items() if not isinstance(value, dict)}
    lines = [f"{key} = {_value(value)}" for key, value in plain.items()]
    for key, value in words.items():
        if isinstance(value, dict):
            inner = (*path, key)
            lines += ["", f"[{'.'.join(inner)}]", *_lines(value, inner)]
    return lines


def _value(value: Any) -> str:
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {_value(part)}" for key, part in value.items()) + " }"
    if isinstance(value, list):
        return "[" + ", ".join(_value(part) for part in value) + "]"
    if isinstance(value, str):
        return f'"{"".join(map(_letter, value))}"'
    return json.dumps(value) if isinstance(value, bool) else repr(value)


def _letter(letter: str) -> str:
    """Return a letter of a text in TOML, which, unlike JSON, knows no halves of letters."""
    is_wide = ord(letter) > 0xFFFF or letter == "\x7f"
    return f"\\U{ord(letter):08x}" if is_wide else json.dumps(letter)[1:-1]


def digest_of(settings: Settings) -> str:
    """Return a digest of all settings."""
    return hashlib.sha256(as_toml(settings).encode()).hexdigest()[:16]
