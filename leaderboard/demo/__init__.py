"""The demo: simulated ground truth, runs of the baselines on rendered frames, all in one terminal."""
