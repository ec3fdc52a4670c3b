"""Quotas: how much, and when, a team may submit.

Boards, submissions and the entry points import this room.
"""
