"""The reproduction as one page, its tables, and in a few lines for a terminal."""
