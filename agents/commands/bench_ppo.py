"""`race bench ppo`: how fast PPO learns, ours beside Stable-Baselines3's."""

from typing import Annotated

import typer

from race_server.cli.document import AsJson, print_document
from race_server.cli.options import names_in
from race_server.errors import ScenarioError, brought_by
from race_server.terminal import Console


def bench_ppo(
    threads: Annotated[int, typer.Option(min=1, help="Of worlds and lessons.")] = 2,
    rollouts: Annotated[
        int, typer.Option(min=1, help="Of each figure, 16,384 decisions each.")
    ] = 8,
    layers: Annotated[str, typer.Option(help="Widths of the layers, such as 256,256.")] = "64,64",
    as_json: AsJson = False,
) -> None:
    """Learn to race with PPO, by our gradients and by Stable-Baselines3's, in turn.

    Ratios hold on a machine that does other things as well; decisions per second need a quiet one.
    """
    with brought_by("train"):
        from race_agents.training.ppo_bench import bench_ppo as measure
    names = names_in(layers)
    if not names or not all(name.isdecimal() and int(name) for name in names):
        raise ScenarioError(f"--layers {layers}: give whole numbers, such as 64,64")
    figures = measure(threads=threads, rollouts=rollouts, layers=[int(name) for name in names])
    if as_json:
        print_document(figures)
        return
    console = Console()
    for name, rate in figures["decisions_per_s"].items():
        console.print(f"{name:13} {rate:8,} decisions/s  {figures['cpu_us'][name]:6.2f} µs of CPU")
    for name in (name for name in figures if "_over_" in name):
        console.print(f"{name}: {figures[name]}")
