"""A measurement that never was: from a model to raw frames."""
