"""What the tests of figures ask of them."""

import numpy as np


def lines(ax, label):
    """Lines of an axes with this label, those of error bars included."""
    found = [line for line in ax.get_lines() if line.get_label() == label]
    return found + [c.lines[0] for c in ax.containers if c.get_label() == label]


def legend(figure):
    return [text.get_text() for text in figure.legends[0].get_texts()]


def numbers_drawn(drawn):
    return sum(np.isfinite(line.get_ydata()).sum() for line in drawn)
