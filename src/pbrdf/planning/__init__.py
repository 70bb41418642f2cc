"""Planning of measurements: which geometries tell most about a model's parameters."""
