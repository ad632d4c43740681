# /// script
# dependencies = ["ray==2.60.0"]
# ///
"""Ray: `race train --ray` on two nodes; a runner, a node, then the driver are killed."""

import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import torch

# Ray gives way to all other programs, so that on a busy machine nothing comes up.
os.environ["RAY_worker_niceness"] = "0"  # noqa: SIM112  # Ray writes it so
from ray.cluster_utils import Cluster

STEPS, WORLDS, ROLLOUT = 360_000, 16, 64  # decisions of each world between lessons
MOST_S = 180.0  # a busy machine needs a minute to begin; what it took is printed
CHANGES = (
    *("network.layers=[16]", "lidar.rays=21", "tracks={names = ['oval']}"),
    *("evaluation.tracks={names = ['oval']}", "evaluation.final={names = ['oval']}"),
    *("evaluation.seeds=2", "evaluation.seconds=3.0", "evaluation.times=1", "warm_start.teacher="),
    f"algorithm.options={{n_steps = {ROLLOUT}, batch_size = 512, n_epochs = 2}}",
)


def start(cluster: Cluster, run: Path, *words: str) -> subprocess.Popen[bytes]:
    """Train on a cluster."""
    ray = ("--ray", cluster.address, "--runners", "2", "--steps", str(STEPS))
    log = (run.parent / "log.txt").open("ab")
    program = (sys.executable, "-m", "race_server", "train", *words, *ray)
    return subprocess.Popen(program, stdout=log, stderr=log)


def decisions(run: Path) -> list[int]:
    """Return how many decisions each row of the curve has counted."""
    try:
        lines = (run / "curve.csv").read_text(encoding="utf-8").splitlines()
    except OSError:
        return []
    return [int(line.split(",")[1]) for line in lines[1:] if line.count(",") > 3]


def wait_beyond(run: Path, steps: int, driver: subprocess.Popen[bytes], most_s: float) -> float:
    """Wait until more is counted than `steps`; return the time that it took [s]."""
    begun = time.monotonic()
    while max(decisions(run), default=0) <= steps:
        assert driver.poll() is None, (run.parent / "log.txt").read_text()[-3000:]
        assert time.monotonic() - begun < most_s, f"nothing counted for {most_s:g} s"
        time.sleep(0.1)
    return time.monotonic() - begun


def runners_of(raylet: int) -> list[int]:
    """Return the runners on one node that have begun: Ray names processes by what they do."""
    found = []
    for place in Path("/proc").glob("[0-9]*"):
        try:
            name = (place / "cmdline").read_bytes()
            parent = int((place / "stat").read_text().rsplit(")", 1)[1].split()[1])
        except OSError:
            continue
        title = name.rstrip(b"\0 ")
        if parent == raylet and title in {b"ray::Runner", b"ray::Runner.collect"}:
            found.append(int(place.name))
    return found


def raylet_of(node: object) -> int:
    """Return the process of Ray on a node."""
    return node.all_processes["raylet"][0].process.pid


def main(run: Path) -> str:
    """Kill what may be killed, and say how long each takes to go on."""
    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 1})
    second = cluster.add_node(num_cpus=1)
    changes = [word for change in CHANGES for word in ("--set", change)]
    words = ("time-trial-ppo", "--worlds", str(WORLDS), "--out", str(run), *changes)
    driver = start(cluster, run, *words)
    wait_beyond(run, 0, driver, 600.0)  # the first one compiles
    nodes = (cluster.head_node, second)
    taken = {}
    for what, kill in (
        ("runner", lambda: os.kill(runners_of(raylet_of(cluster.head_node))[0], signal.SIGKILL)),
        ("node", lambda: cluster.remove_node(second, allow_graceful=False)),
    ):
        begun = time.monotonic()
        while not all(runners_of(raylet_of(node)) for node in nodes):
            assert time.monotonic() - begun < 300.0, "a node has no runner"
            time.sleep(0.2)
        before = max(decisions(run))
        kill()
        # One rollout may have been on its way: the next but one is there without what was killed.
        taken[what] = wait_beyond(run, before + 2 * ROLLOUT * WORLDS, driver, MOST_S)
    time.sleep(10.0)  # until a checkpoint knows of it
    driver.kill()
    driver.wait()
    kept, written = known_to(run), (run / "curve.csv").stat().st_mtime_ns
    begun = time.monotonic()
    driver = start(cluster, run, "--resume", str(run))
    # It first cuts off the curve what no checkpoint knows of.
    while (run / "curve.csv").stat().st_mtime_ns == written:
        assert time.monotonic() - begun < MOST_S, "the driver did not begin"
        time.sleep(0.1)
    wait_beyond(run, kept, driver, MOST_S)
    taken["driver"] = time.monotonic() - begun
    driver.wait(timeout=600.0)
    assert driver.returncode == 0, (run.parent / "log.txt").read_text()[-3000:]
    cluster.shutdown()
    check(run)
    words = ", ".join(f"{what} {seconds:.0f} s" for what, seconds in taken.items())
    return f"{decisions(run)[-1]} decisions, each counted and learned once; gone on after: {words}"


def known_to(run: Path) -> int:
    """Return how many decisions the latest checkpoint has counted."""
    return int(torch.load(run / "latest.pt", weights_only=True)["done"])


def check(run: Path) -> None:
    """Check that as much was learned from as was counted, and nothing twice."""
    latest = torch.load(run / "latest.pt", weights_only=True)
    lessons = latest["counters"]["_n_updates"] // 2
    assert latest["done"] // (ROLLOUT * WORLDS) == lessons, (latest["done"], lessons)
    assert STEPS <= latest["done"] < STEPS + ROLLOUT * WORLDS
    counted = decisions(run)
    assert counted == sorted(counted), counted


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        print(main(Path(folder) / "run"))
