"""Which material a measurement shows: libraries of materials, sets at a stated confidence, calibration."""
