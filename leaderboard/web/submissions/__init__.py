"""Pages of submissions: the form, the state, the result, the error analysis, the receipt."""
