"""Editions: splits, quoted results and ground truth; correct, preview, publish and roll back."""
