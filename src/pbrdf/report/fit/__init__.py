"""A fit in words, figures and files."""
