"""A polarimeter and its calibration in words and figures."""
