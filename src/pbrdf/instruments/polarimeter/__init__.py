"""A polarimeter and its detector: analyser vectors, figures of merit, noise, files that describe them."""
