"""People: teams, invitations, API tokens, and names that look alike."""
