"""Geometries: rays, protocols of a goniometer, the light source, tables of angles."""
