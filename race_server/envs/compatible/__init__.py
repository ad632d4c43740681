"""Environments of ours with the spaces, rewards and infos of highway-env's.

What was written for `parking-v0` or `racetrack-v0` of version 1.12.1 runs with them unchanged
(https://github.com/Farama-Foundation/HighwayEnv). Only the second needs highway-env, for its roads.
"""
