"""The learner: Stable-Baselines3's algorithm on the training world, made from settings."""

import inspect
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import numpy as np
import torch
from stable_baselines3 import DQN, PPO, SAC, TD3
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.logger import Logger
from stable_baselines3.common.noise import NormalActionNoise
from stable_baselines3.common.off_policy_algorithm import OffPolicyAlgorithm
from stable_baselines3.common.type_aliases import TrainFrequencyUnit
from stable_baselines3.common.vec_env import VecEnv, VecNormalize

from race_agents.training.active_rollout import ActiveRollout
from race_agents.training.budget import Budget
from race_agents.training.curiosity import Curious
from race_agents.training.curriculum import Curriculum
from race_agents.training.fast_ppo import FastPpo
from race_agents.training.gail import Discriminator
from race_agents.training.hurl import Foretelling, MixingBuffer
from race_agents.training.mappo import Mappo
from race_agents.training.normaliser import Normaliser
from race_agents.training.poca import Poca
from race_agents.training.reward_wrapper import Judge, RewardWrapper, width_of
from race_agents.training.schedule import deviations
from race_agents.training.settings import Settings
from race_agents.training.tasks import training_task
from race_agents.training.view import ObservationView
from race_server.envs.sb3 import KartVecEnv
from race_server.errors import ScenarioError

CLASSES: dict[str, type[BaseAlgorithm]] = {
    "ppo": FastPpo,
    "ppo-sb3": PPO,
    "mappo": Mappo,
    "poca": Poca,
    "sac": SAC,
    "td3": TD3,
    "dqn": DQN,
}
ACTIVATIONS = {"tanh": torch.nn.Tanh, "relu": torch.nn.ReLU}
# Options that come from elsewhere in the settings, or that a run decides itself.
_TAKEN = {
    *("self", "policy", "env", "learning_rate", "seed", "device", "verbose", "tensorboard_log"),
    *("policy_kwargs", "_init_setup_model", "stats_window_size", "action_noise", "agents"),
    *("replay_buffer_class", "replay_buffer_kwargs"),
    *("rollout_buffer_class", "rollout_buffer_kwargs"),
}
# Deviation of what TD3 adds to its actions, unless `options.action_noise` says otherwise.
TD3_NOISE = 0.1


def world_of(
    settings: Settings,
    budget: Budget,
    around: Callable[[KartVecEnv], VecEnv] | None = None,
    karts: VecEnv | None = None,
) -> Normaliser:
    """Return the karts that learn, with running means of their observations.

    around: wrapper between the karts and the learner; default: the judges of the settings. karts:
    default: all learners of a new batch.

    Raises:
        RaceError: the settings are not valid.
    """
    if karts is None:
        karts = KartVecEnv(
            training_task(settings),
            worlds=settings.worlds,
            seed=settings.seed,
            threads=settings.threads,
            curriculum=Curriculum(settings, budget) if settings.curriculum else None,
        )
    shown = _judged(settings, karts)
    if around is not None:
        assert isinstance(karts, KartVecEnv)
        shown = around(karts)
    rewards, gamma = settings.algorithm.normalise_reward, settings.gamma
    return Normaliser(shown, ObservationView.of(settings), norm_reward=rewards, gamma=gamma)


def _judged(settings: Settings, karts: VecEnv) -> VecEnv:
    """Return the karts with the rewards of all judges, and the heuristic, in the settings."""
    gail, curiosity = settings.gail, settings.curiosity
    if settings.mixes:
        karts = Foretelling(karts, settings)
    if gail.demonstrations:
        judge: Judge = Discriminator(settings)
        karts = RewardWrapper(karts, judge, own_share=gail.own_share, decisions=gail.decisions)
    if curiosity.bonus > 0.0:
        size, width = width_of(karts.observation_space), width_of(karts.action_space)
        judge = Curious(curiosity, size, width, settings.seed)
        karts = RewardWrapper(karts, judge, own_share=1.0, decisions=curiosity.decisions)
    return karts


@contextmanager
def without_warnings() -> Iterator[None]:
    """Hide what Stable-Baselines3 warns of: settings are checked here."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", module="stable_baselines3")
        yield


def learner_of(
    settings: Settings,
    world: VecNormalize,
    budget: Budget,
    log: str | None,
    more: Mapping[str, Any] | None = None,
    kind: type[BaseAlgorithm] | None = None,
) -> Any:
    """Return an untrained learner.

    log: a folder for TensorBoard; kind: instead of the algorithm's class, with more options.

    Raises:
        ScenarioError: an option of the algorithm does not exist, or its value is not valid.
    """
    # With two, `time-trial` made 3,800 decisions a second instead of 29,000: networks as small as
    # these lose more by threads that wait for one another than they gain.
    torch.set_num_threads(1)
    name = settings.algorithm.name
    kind = kind or CLASSES[name]
    options = _options(settings) | dict(more or {})
    if name == "td3":
        width = world.action_space.shape[0]  # type: ignore[index]  # settings keep it a box
        deviation = np.full(width, TD3_NOISE)
        options["action_noise"] = NormalActionNoise(np.zeros(width), deviation)
    if settings.mixes and not issubclass(kind, PPO):
        if options.get("n_steps", 1) != 1:
            raise ScenarioError(
                f"algorithm.options.n_steps = {options['n_steps']}: with parking.shaping = 'hurl' "
                "targets are of one step; leave it out"
            )
        options["replay_buffer_class"] = MixingBuffer
    options |= _options_of_team(settings, world)
    if issubclass(kind, FastPpo):
        options["threads"] = settings.threads
        options["halves"] = settings.network.products == "bfloat16"
    network: dict[str, Any] = {
        "net_arch": list(settings.network.layers),
        "activation_fn": ACTIVATIONS[settings.network.activation],
    }
    if issubclass(kind, PPO):
        network["log_std_init"] = settings.network.log_std
    try:
        learner = kind(
            "MlpPolicy",
            world,
            learning_rate=_rate(settings, budget),
            policy_kwargs=network,
            seed=settings.seed,
            device="cpu",
            tensorboard_log=log,
            **options,
        )
    except (TypeError, ValueError, ArithmeticError, AssertionError) as error:
        raise ScenarioError(f"algorithm.options of {name}: {error}") from error
    if log is None:
        learner.set_logger(Logger(None, []))  # by default each learner leaves an empty folder
    _prepare(learner, settings, budget)
    return learner


def _prepare(learner: BaseAlgorithm, settings: Settings, budget: Budget) -> None:
    """Check what only a learner knows of its options, and let it explore as the settings say."""
    if isinstance(learner, OffPolicyAlgorithm):
        _check_episodes(learner)
    if isinstance(learner, DQN):
        _explore_by(learner, budget)
    if isinstance(learner, PPO):
        _check_deviations(learner, settings)
        _answer_at_first(learner, settings.network.first_action)


def _options(settings: Settings) -> dict[str, Any]:
    kind = CLASSES[settings.algorithm.name]
    documented = PPO if issubclass(kind, FastPpo) else kind
    known = [name for name in inspect.signature(documented).parameters if name not in _TAKEN]
    for key, value in settings.algorithm.options.items():
        if key not in known:
            raise ScenarioError(
                f"algorithm.options.{key} = {value!r}: {settings.algorithm.name} has no such "
                f"option; known are {', '.join(known)}; "
                "--set algorithm.options={} takes their defaults"
            )
    return {
        key: tuple(value) if isinstance(value, list) else value
        for key, value in settings.algorithm.options.items()
    }


def _options_of_team(settings: Settings, world: VecNormalize) -> dict[str, Any]:
    """Return the options that several vehicles need that learn in one lot."""
    if settings.algorithm.name == "poca":
        return {"agents": settings.race.learners}
    waits = settings.parks and settings.race.learners > 1 and not settings.parking.team
    if not waits:
        return {}
    return {"rollout_buffer_class": ActiveRollout, "rollout_buffer_kwargs": {"world": world}}


def _rate(settings: Settings, budget: Budget) -> Any:
    """Return a schedule by the budget: the learner's own has no minutes."""
    first, warm = settings.algorithm.learning_rate, settings.warm_start
    last = settings.algorithm.last_learning_rate
    change = 0.0 if last is None else last - first

    def rate(_: float) -> float:
        if warm.critic_learning_rate is not None and budget.share < warm.critic_end:
            return warm.critic_learning_rate
        return first + budget.share_since(warm.critic_end) * change

    return rate


def _explore_by(learner: DQN, budget: Budget) -> None:
    first, last = learner.exploration_initial_eps, learner.exploration_final_eps
    until = learner.exploration_fraction

    def chance(_: float) -> float:
        return first + min(budget.share / max(until, 1e-9), 1.0) * (last - first)

    learner.exploration_schedule = chance


def _check_episodes(learner: OffPolicyAlgorithm) -> None:
    """Refuse lessons by episodes of several karts before the first one, which would end it."""
    count, unit = learner.train_freq.frequency, learner.train_freq.unit  # type: ignore[union-attr]
    if unit == TrainFrequencyUnit.EPISODE and learner.n_envs > 1:
        raise ScenarioError(
            f"algorithm.options.train_freq = [{count}, 'episode']: {learner.n_envs} karts learn at "
            "once, whose episodes end apart; give a number of decisions, or learn with one kart"
        )


def _check_deviations(learner: PPO, settings: Settings) -> None:
    """Refuse deviations that do not fit the action before they are used, minutes later."""
    own: Any = getattr(learner.policy, "log_std", None)  # discrete actions have none
    for wanted in (settings.warm_start.log_std, settings.network.last_log_std):
        if own is not None and wanted is not None:
            deviations(wanted, own)


def _answer_at_first(learner: PPO, action: tuple[float, ...]) -> None:
    if not action:
        return
    network: Any = learner.policy.action_net
    bias = network.bias.data
    if len(action) != len(bias):
        raise ScenarioError(
            f"network.first_action = {list(action)}: the action has {len(bias)} numbers"
        )
    network.weight.data *= 0.1  # so that the observation hardly matters at first
    bias[:] = torch.tensor(action)
