"""Learning to drive: settings, learner, evaluation, and the folder of a run."""
