"""What the wire carries: frames that were captured, or a model of them, as bytes by topic, cause and layer."""
