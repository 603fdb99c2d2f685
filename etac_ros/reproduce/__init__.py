"""Every published figure beside a measured one, its band, and a verdict that follows from the numbers by a rule."""
