"""Measured data in words, and drawn with a model's values beside them."""
