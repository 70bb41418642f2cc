"""Instruments: polarimeters, their calibration and reduction, the detector, the goniometer."""
