"""Scenarios: one experiment, one YAML file, validated once, with errors that say which key is meant."""
