"""Models, data and fits drawn together."""
