"""Plants: continuous attitude dynamics, one file a kind."""
