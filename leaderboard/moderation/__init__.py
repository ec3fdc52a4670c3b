"""Moderation: hide methods and teams, move and close accounts, forget people, delete empty methods."""
