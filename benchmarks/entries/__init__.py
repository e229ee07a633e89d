"""One module for each entry of the table, with a function `rows(settings)`."""
