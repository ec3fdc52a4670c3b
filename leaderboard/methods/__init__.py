"""Methods: the details that a team states about a method, and who may see it."""
