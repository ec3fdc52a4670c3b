"""Pages of an account: sign-up, team, invitations, API tokens."""
