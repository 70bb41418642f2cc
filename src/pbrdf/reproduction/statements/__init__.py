"""The paper's statements, each as a test of the model."""
