"""Raw frames and the files that hold them."""
