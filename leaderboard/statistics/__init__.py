"""Scoring: from a queued evaluation to scores, confidence intervals, comparisons and error analysis.

Editions, submissions and workers import this room; it reads boards and stored files.
"""
