"""Tables: one kind of value, shown in a terminal, on a page or as Markdown; and how figures are written."""
