"""Ground truth and manifests: tables, annotation files, sequence numbers."""
