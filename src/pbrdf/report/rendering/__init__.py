"""Rendered pictures drawn."""
