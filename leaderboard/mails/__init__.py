"""Mails that may fail: sent at once or kept and sent later, and notices that people can switch off.

Pages, workers and commands import this room; it reads the tables alone.
"""
