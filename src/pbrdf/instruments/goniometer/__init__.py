"""Geometries: rays, protocols of a goniometer and errors of its angles, the light source, tables of angles."""
