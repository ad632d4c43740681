"""Runners as Ray's actors, on all machines of a cluster; needs the extra `ray`.

A runner that dies with its process or its machine is left out, and its part of the rollout is asked
of another at once. One in its place is asked for at the same time: it joins as soon as the cluster
has a core for it, which may be on a machine that joins later.
"""

import time
from dataclasses import dataclass
from typing import Any

import ray

from race_agents.training.far_ppo import worlds_of_each
from race_agents.training.far_runner import Parameters, Rollout, Runner
from race_agents.training.settings import Settings
from race_server.errors import ScenarioError

HERE = "local"  # in place of an address: a cluster of this machine
LOOK_S = 1.0  # between two looks for runners that have come up
ALONE_S = 300.0  # without any runner


@dataclass
class Hand:
    """A runner that was asked for."""

    actor: Any
    ready: Any  # a reference; done once its worlds stand
    part: int = -1  # that it collects; -1: none


class RayCrew:
    """Runners of one training on a cluster."""

    def __init__(self, settings: Settings, address: str, runners: int) -> None:
        """Join a cluster. runners: 0 for one on each core but one.

        Raises:
            ScenarioError: there is none at the address, or worlds cannot be shared evenly.
        """
        join: dict[str, Any] = {"log_to_driver": False, "logging_level": "ERROR"}
        try:
            if address == HERE:
                ray.init(include_dashboard=False, **join)
            else:
                ray.init(address=address, **join)
        except (ConnectionError, ValueError, RuntimeError) as error:
            raise ScenarioError(f"--ray {address}: no cluster answers there: {error}") from error
        self._settings = settings
        self.count = runners or _fitting(settings)
        self._worlds = worlds_of_each(settings, self.count)
        self._kind: Any = ray.remote(num_cpus=1, scheduling_strategy="SPREAD")(Runner)
        self.hands: list[Hand] = []  # that work
        self.coming: list[Hand] = []
        self.lost = 0  # runners so far
        self._seed = 0  # of the next runner

    def begin(self, seed: int) -> None:
        """Ask for all runners, and wait for the first."""
        self._seed = seed
        self.coming = [self._ask() for _ in range(self.count)]
        while len(self.hands) < self.count and self._welcome(ALONE_S if not self.hands else LOOK_S):
            pass

    def _ask(self) -> Hand:
        """Ask for a runner, whose worlds have seeds that no other had."""
        actor = self._kind.remote(self._settings, self._worlds, self._seed)
        self._seed += self._worlds
        return Hand(actor, actor.__ray_ready__.remote())

    def _welcome(self, wait_s: float) -> bool:
        """Let those work that have come up; return whether one has.

        Raises:
            ScenarioError: a runner cannot be built at all.
        """
        if not self.coming:
            return False
        waited = [hand.ready for hand in self.coming]
        done, _ = ray.wait(waited, num_returns=1, timeout=wait_s)
        for hand in [one for one in self.coming if one.ready in done]:
            self.coming.remove(hand)
            try:
                ray.get(hand.ready)
                self.hands.append(hand)
            except ray.exceptions.RayError as error:
                if not _is_lost(error):
                    raise ScenarioError(f"a runner cannot begin: {error}") from error
                self._replace()
        return bool(done)

    def collect(self, parameters: Parameters) -> list[Rollout]:
        """Return all parts of a rollout; each is of one runner, also where some died."""
        sent = ray.put(parameters)
        found: dict[int, Rollout] = {}
        waiting, asked = list(range(self.count)), dict[Any, Hand]()
        alone_since = time.monotonic()
        while len(found) < self.count:
            self._welcome(0.0)
            for hand in [one for one in self.hands if one.part < 0]:
                if waiting:
                    hand.part = waiting.pop(0)
                    asked[hand.actor.collect.remote(sent)] = hand
            if self.hands:
                alone_since = time.monotonic()
            elif not self._welcome(LOOK_S) and time.monotonic() - alone_since > ALONE_S:
                raise ScenarioError(f"no runner came up within {ALONE_S:g} s: look at `ray status`")
            if not asked:
                continue
            for reference in ray.wait(list(asked), num_returns=1, timeout=LOOK_S)[0]:
                hand = asked.pop(reference)
                try:
                    found[hand.part] = ray.get(reference)
                except ray.exceptions.RayError as error:
                    if not _is_lost(error):
                        raise
                    waiting.append(hand.part)
                    self.hands.remove(hand)
                    self._replace()
                hand.part = -1
        return [found[part] for part in range(self.count)]

    def _replace(self) -> None:
        self.lost += 1
        self.coming.append(self._ask())

    def close(self) -> None:
        """Leave the cluster; its runners end."""
        ray.shutdown()


def _is_lost(error: Exception) -> bool:
    """Return whether a process or a machine is gone, rather than the program wrong."""
    gone = (ray.exceptions.RayActorError, ray.exceptions.ObjectLostError)
    return isinstance(error, gone) and "creation task" not in str(error)


def _fitting(settings: Settings) -> int:
    """Return the most runners, at most one on each core but one, that share the worlds evenly."""
    cores = max(int(ray.cluster_resources().get("CPU", 1.0)) - 1, 1)
    return max(n for n in range(1, min(cores, settings.worlds) + 1) if not settings.worlds % n)
