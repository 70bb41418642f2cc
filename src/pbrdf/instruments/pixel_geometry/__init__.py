"""Directions of source and camera at every pixel of a picture, and maps of Stokes parameters in the surface's axes."""
