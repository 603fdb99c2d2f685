"""Trade-off curves: what a law's traffic buys in accuracy and energy, event-triggered against periodic."""
