"""Learning to drive: settings, learner, evaluation, and the folder that a run leaves behind."""
