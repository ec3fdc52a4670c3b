"""Boards: the rows of a split in one edition, now or as of a time: ranking, filters, what is kept of them."""
