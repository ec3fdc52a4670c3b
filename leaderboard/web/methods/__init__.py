"""Pages of methods: results, details and visibility."""
