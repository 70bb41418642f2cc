"""What measures: instruments, their frames and geometries, and the way from these to data sets.

Each room imports only from those above it:

==================  ================================================================================
``polarimeter``     analyser vectors, detector, noise, an instrument and its files
``frames``          raw frames and the files that hold them
``goniometer``      geometries: rays, protocols, the light source, angle tables
``reduction``       from frames to Stokes parameters: maps, regions, data sets
``calibration``     from frames of known light to an instrument
``virtual``         frames of a measurement that never was
==================  ================================================================================
"""
