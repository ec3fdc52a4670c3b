"""Errors: one refusal for everything that people may do wrong, problem codes, outages."""
