"""The training world: batch, PettingZoo, Gymnasium. Importing it registers the ids of both."""

from race_server.envs.registration import register_gymnasium, register_pettingzoo

register_gymnasium()
register_pettingzoo()
