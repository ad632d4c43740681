"""Checks of the values under `algorithm.options`, before anything is built with them.

Stable-Baselines3 checks few of its options, so that a wrong one would fail in the first lesson, or
teach nothing without a word.
"""

import math
from collections.abc import Callable
from typing import Any

from race_server.errors import ScenarioError

Option = tuple[Callable[[Any], bool], str]  # what a value has to fulfil, and that in words


def _is_number(value: Any) -> bool:
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    return is_number and math.isfinite(value)


def _is_whole(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool)


def _whole(least: int) -> Option:
    return lambda value: _is_whole(value) and value >= least, f"a whole number from {least} on"


def _times(value: Any) -> bool:
    """Return whether a value is a number of decisions, or of decisions or episodes with a word."""
    count, unit = value if isinstance(value, list) and len(value) == 2 else (value, "step")
    return _is_whole(count) and count >= 1 and unit in {"step", "episode"}


def _auto(value: Any) -> bool:
    return isinstance(value, str) and value.startswith("auto")


_SHARE: Option = (lambda value: _is_number(value) and 0.0 <= value <= 1.0, "a number from 0 to 1")
_SIZE: Option = (lambda value: _is_number(value) and value >= 0.0, "a number from 0 on")
_WORD: Option = (lambda value: isinstance(value, bool), "true or false")
_NUMBER: Option = (lambda value: _is_number(value) or _auto(value), "a number, or 'auto'")
_OPTIONS: dict[str, Option] = {
    **dict.fromkeys(("n_steps", "batch_size", "n_epochs", "buffer_size"), _whole(1)),
    **dict.fromkeys(("policy_delay", "target_update_interval"), _whole(1)),
    "learning_starts": _whole(0),
    **dict.fromkeys(("gradient_steps", "sde_sample_freq"), _whole(-1)),
    **dict.fromkeys(("gamma", "gae_lambda", "tau", "exploration_fraction"), _SHARE),
    **dict.fromkeys(("exploration_initial_eps", "exploration_final_eps"), _SHARE),
    **dict.fromkeys(("clip_range", "clip_range_vf", "vf_coef", "max_grad_norm"), _SIZE),
    **dict.fromkeys(("target_kl", "target_policy_noise", "target_noise_clip"), _SIZE),
    **dict.fromkeys(("use_sde", "use_sde_at_warmup", "normalize_advantage"), _WORD),
    "optimize_memory_usage": _WORD,
    **dict.fromkeys(("ent_coef", "target_entropy"), _NUMBER),
    "train_freq": (_times, "a whole number from 1 on, or such a number with 'step' or 'episode'"),
}


def check_options(options: dict[str, Any], source: str) -> None:
    """Check the values of options; what an algorithm does not know is refused where it is made.

    Raises:
        ScenarioError: one is of another kind, or out of its bounds.
    """
    for key, value in options.items():
        fits, wanted = _OPTIONS.get(key, (lambda _: True, ""))
        if not fits(value):
            raise ScenarioError(f"{source}: algorithm.options.{key} = {value!r:.60}: give {wanted}")
