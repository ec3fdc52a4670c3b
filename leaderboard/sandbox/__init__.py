"""Sandbox: prediction files read by a child process without rights, as values in the order of an edition."""
