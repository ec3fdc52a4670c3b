"""Quotas: how much, and when, a team may submit."""
