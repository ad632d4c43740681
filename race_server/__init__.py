"""A race and game server for karts, and the same world as a training environment."""

import importlib
import sys

__version__ = "0.1.0"

# `gym.make("race_server:Kart/Race-v0")` imports this package and then looks the id up. Whoever
# does not use Gymnasium, a driver's process above all, does not pay for importing it.
if "gymnasium" in sys.modules:
    importlib.import_module("race_server.envs.registration").register_gymnasium()
