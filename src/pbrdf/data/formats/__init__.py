"""The file formats of measured data, one module each, beside what they share."""
