"""Reports of what a fit found: text, figures and files."""
