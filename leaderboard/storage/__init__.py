"""Storage: bytes of prediction files (local or S3), public manifests, and the private ground-truth values."""
