"""A model drawn."""
