"""Storage: bytes of prediction files (local or S3), public manifests, and the private ground-truth values.

Every room above may import this one; it imports no other domain room.
"""
