"""The benchmark: its splits and the rows quoted from papers.

Rooms that score, rank or show may import this one; it imports none of them.
"""
