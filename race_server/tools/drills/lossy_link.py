"""A bad link between two network namespaces: it loses, delays and reorders packets.

Both ends are TUN devices whose packets pass through this process, so it works where the kernel
has no `netem`. Needs root, `ip` and /dev/net/tun (Linux).
"""

import fcntl
import heapq
import os
import random
import select
import shutil
import struct
import subprocess
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path

from race_server.errors import RaceError

TUN = Path("/dev/net/tun")
# linux/if_tun.h
_TUNSETIFF = 0x400454CA
_IFF_TUN, _IFF_NO_PI = 0x0001, 0x1000
MOST_BYTES = 1 << 16
# In 127/8, which no other machine can reach: a server needs no keys there.
ADDRESSES = ("127.77.0.1", "127.77.0.2")


def why_not() -> str:
    """Return why there can be no such link on this machine, "" if there can."""
    if os.name != "posix" or os.geteuid() != 0:
        return "network namespaces need root"
    if shutil.which("ip") is None:
        return "the program `ip` is not installed (package iproute2)"
    if not TUN.exists():
        return f"{TUN} is missing: the kernel or the container has no TUN devices"
    name = f"race-try-{os.getpid()}"
    try:
        _ip("netns", "add", name)
        _ip("netns", "del", name)
    except RaceError as error:
        return f"no network namespace can be made: {error}"
    return ""


@dataclass(frozen=True)
class LinkConditions:
    """What a link does to each packet, in each direction."""

    loss: float = 0.0  # share of packets
    delay_s: float = 0.0
    jitter_s: float = 0.0  # uniform deviation from the delay; packets may overtake each other

    def figures(self) -> dict[str, float]:
        """Return the conditions as figures of a drill."""
        return {
            "loss": self.loss,
            "delay_ms": 1e3 * self.delay_s,
            "jitter_ms": 1e3 * self.jitter_s,
        }


@dataclass
class LossyLink:
    """Two namespaces and the packets between them."""

    names: tuple[str, str]
    devices: tuple[int, int]  # file descriptors
    weather: LinkConditions
    chance: random.Random
    passed: int = 0
    lost: int = 0
    _on_way: list[tuple[float, int, int, bytes]] = field(default_factory=list)
    _ended: threading.Event = field(default_factory=threading.Event)

    def carry(self) -> None:
        """Carry packets until the link is cut."""
        while not self._ended.is_set():
            due = self._on_way[0][0] - time.monotonic() if self._on_way else 0.05
            ready, _, _ = select.select(self.devices, [], [], min(max(due, 0.0), 0.05))
            for device in ready:
                self.receive(device)
            self._deliver(time.monotonic())

    def cut(self) -> None:
        """Stop carrying packets."""
        self._ended.set()

    def receive(self, device: int) -> None:
        """Receive a packet of a device: lose it, or send it on when it is due."""
        packet = os.read(device, MOST_BYTES)
        if self.chance.random() < self.weather.loss:
            self.lost += 1
            return
        self.passed += 1
        jitter = self.chance.uniform(-self.weather.jitter_s, self.weather.jitter_s)
        due = time.monotonic() + max(self.weather.delay_s + jitter, 0.0)
        other = self.devices[1 - self.devices.index(device)]
        heapq.heappush(self._on_way, (due, self.passed, other, packet))

    def _deliver(self, now: float) -> None:
        while self._on_way and self._on_way[0][0] <= now:
            _, _, device, packet = heapq.heappop(self._on_way)
            with suppress(OSError):  # the other end is being taken down
                os.write(device, packet)


def within(name: str) -> list[str]:
    """Return the arguments in front of a command that runs it in a namespace."""
    return ["ip", "netns", "exec", name]


@contextmanager
def lossy_link(weather: LinkConditions, seed: int) -> Iterator[LossyLink]:
    """Return two namespaces with a link between them, removed after the block.

    Raises:
        RaceError: they cannot be made.
    """
    names = (f"race-{os.getpid()}-0", f"race-{os.getpid()}-1")
    devices: list[int] = []
    try:
        for end, name in enumerate(names):
            _ip("netns", "add", name)
            devices.append(_plug_in(name, f"wire{end}p{os.getpid() % 100000}", end))
        wire = LossyLink(names, (devices[0], devices[1]), weather, random.Random(seed))
        thread = threading.Thread(target=wire.carry, name="wire", daemon=True)
        thread.start()
        try:
            yield wire
        finally:
            wire.cut()
            thread.join()
    finally:
        for device in devices:
            os.close(device)
        for name in names:
            with suppress(RaceError):
                _ip("netns", "del", name)


def _plug_in(namespace: str, device: str, end: int) -> int:
    """Return the open end of a link that leads into a namespace."""
    tun = os.open(TUN, os.O_RDWR)
    fcntl.ioctl(tun, _TUNSETIFF, struct.pack("16sH", device.encode(), _IFF_TUN | _IFF_NO_PI))
    _ip("link", "set", device, "netns", namespace)
    # Without this the kernel takes addresses of 127/8 for forged ones on any device but lo.
    setting = f"/proc/sys/net/ipv4/conf/{device}/route_localnet"
    _run([*within(namespace), "sh", "-c", f"echo 1 > {setting}"])
    own, other = ADDRESSES[end], ADDRESSES[1 - end]
    _ip("-n", namespace, "address", "add", own, "peer", other, "dev", device)
    _ip("-n", namespace, "link", "set", device, "up")
    # Packets of an end to itself pass through lo, which must not take all of 127/8.
    _ip("-n", namespace, "link", "set", "lo", "up")
    _ip("-n", namespace, "address", "flush", "dev", "lo")
    return tun


def _ip(*words: str) -> None:
    _run(["ip", *words])


def _run(command: list[str]) -> None:
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise RaceError(f"{' '.join(command)}: {done.stderr.strip() or done.stdout.strip()}")
