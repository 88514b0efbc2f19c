"""What is drawn in a matplotlib figure."""


def panels(figure, letters):
    """The axes of a figure whose titles begin with "(a)", "(b)", ..., for each of the letters."""
    titles = {axes.get_title(loc="left")[:3]: axes for axes in figure.get_axes()}
    return [titles[f"({letter})"] for letter in letters]


def curves(axes):
    """{label: (x, y)} of the lines of some axes."""
    return {line.get_label(): line.get_data() for line in axes.lines}
