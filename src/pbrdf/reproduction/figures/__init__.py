"""The paper's figures, drawn from the simulated measurement."""
