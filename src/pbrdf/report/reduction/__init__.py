"""A reduction in words, pictures and files."""
