"""Calibration of a polarimeter from frames of known light."""
