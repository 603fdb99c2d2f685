"""What loss and delay on its network links do to a scenario, event-triggered beside periodic."""
