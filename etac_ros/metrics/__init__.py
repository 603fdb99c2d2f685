"""What a recorded run amounts to: its summary, curves, decisions, and the figures that stand beside published ones."""
