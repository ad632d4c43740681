"""`race exam`: what drivers can do, counted over many tasks."""

import typer

from race_agents.commands.exam_coaching import coaching
from race_agents.commands.exam_laps import laps
from race_agents.commands.exam_parking import parking, trailer
from race_agents.commands.exam_races import races
from race_agents.commands.exam_retention import retention
from race_agents.commands.exam_sweep import sweep

app = typer.Typer(help="Examine drivers on many tasks, each decided by its seed.")
for command in (parking, trailer, laps, races, sweep, coaching, retention):
    app.command()(command)


@app.callback()
def _group() -> None:
    """Examine drivers on many tasks, each decided by its seed."""
