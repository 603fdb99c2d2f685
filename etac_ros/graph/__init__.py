"""The mechanism: modules, the links that join them, what drives a module, and what a run leaves behind."""
