"""Pages of documentation: the guide and the reference of the API."""
