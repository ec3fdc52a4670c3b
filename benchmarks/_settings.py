"""The production settings, with an empty view beside the leaderboard's own addresses."""

from leaderboard.settings import *  # noqa: F403

ROOT_URLCONF = "benchmarks._urls"
