"""The demo: simulated ground truth, invented submissions, and everything in one terminal."""
