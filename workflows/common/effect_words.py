"""Names of effects in words, as figures, titles and pages have them."""


def effect_words(name: str) -> str:
    """The name of an effect as a text has it: "coulomb_friction" is "Coulomb friction"."""
    words = name.replace("_", " ")
    for who in ("coulomb", "hertz", "mindlin"):
        words = words.replace(who, who.capitalize())
    return words
