"""Charts: of a board, a method, a paper and a submission, each with its table."""
