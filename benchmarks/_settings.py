"""The production settings, with an empty view added to the leaderboard's addresses."""

from leaderboard.settings import *  # noqa: F403

ROOT_URLCONF = "benchmarks._urls"
