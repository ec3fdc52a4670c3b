"""Prediction files: bytes in, values aligned with a manifest out, or a `Rejected` that says why."""
