"""The training world: batch, PettingZoo, Gymnasium. Importing it registers the Gymnasium ids."""

from race_server.gym_ids import register

register()
