"""A plan of measurements in words and as a figure."""
