"""The paper's measurement, simulated, and what the inversion made of it."""
