"""A map of parameters in pictures, words and a page."""
