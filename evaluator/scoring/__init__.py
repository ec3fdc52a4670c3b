"""Scores of predictions, their confidence intervals, and the significance of differences."""
