"""One file for each table; its name, with dashes, is that of the reproduction."""
