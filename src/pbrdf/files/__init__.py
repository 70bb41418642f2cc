"""Files as such, whatever they hold: written whole or not at all, text, tables, netCDF read under guard."""
