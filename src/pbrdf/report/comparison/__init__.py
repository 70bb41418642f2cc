"""Several models on the same data: ranking, curves, folder."""
