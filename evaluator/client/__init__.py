"""The HTTP client of the leaderboard's API, for the command line."""
