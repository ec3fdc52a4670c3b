"""Statistics: confidence intervals, rank ranges, comparisons and error analysis of scored files."""
