"""Trigger rules: one file a rule, vectorised over a window of samples."""
