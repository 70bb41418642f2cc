"""The explorer: models, measurements and maps in a browser, computed here by Dr.Jit."""
