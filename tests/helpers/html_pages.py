"""What a page of HTML consists of, by Python's own parser."""

from html.parser import HTMLParser
from itertools import pairwise

ALONE = {"meta", "img", "link", "br", "hr", "input"}  # elements without an end


class Page(HTMLParser):
    """Elements, texts and mistakes of a page.

    Attributes
    ----------
    elements
        (name, attributes) of each, in order.
    texts
        Text by the name of the element that it is directly in, in order: [(name, text), ...].
    rows
        Cells of the rows of all tables.
    mistakes
        Elements that end where they did not begin.
    """

    def __init__(self, text):
        super().__init__(convert_charrefs=True)
        self.elements, self.texts, self.rows, self.mistakes, self._open = [], [], [], [], []
        self.feed(text)
        self.close()
        self.mistakes += [f"{name} does not end" for name in self._open]

    def handle_starttag(self, tag, attrs):
        self.elements.append((tag, dict(attrs)))
        if tag == "tr":
            self.rows.append([])
        if tag in ("td", "th"):
            self.rows[-1].append("")
        if tag not in ALONE:
            self._open.append(tag)

    def handle_endtag(self, tag):
        if not self._open or self._open.pop() != tag:
            self.mistakes.append(f"{tag} ends at {self.getpos()}")

    def handle_data(self, data):
        inside = self._open[-1] if self._open else ""
        self.texts.append((inside, data))
        if inside in ("td", "th"):
            self.rows[-1][-1] += data

    def all(self, name):
        """Attributes of all elements of a name."""
        return [attributes for tag, attributes in self.elements if tag == name]

    def words(self, *names):
        """Texts directly in elements of these names."""
        return [text.strip() for tag, text in self.texts if tag in names and text.strip()]


def check_page(text):
    """The page, if it is well formed, can be read by all, and needs nothing else."""
    page = Page(text)
    assert text.startswith("<!DOCTYPE html>") and not page.mistakes
    assert page.all("html")[0]["lang"] == "en" and page.words("title") and len(page.all("h1")) == 1
    levels = [int(tag[1]) for tag, _ in page.elements if tag in ("h1", "h2", "h3", "h4")]
    assert levels[0] == 1 and all(b - a <= 1 for a, b in pairwise(levels))
    assert not {"script", "iframe", "object", "embed", "svg", "link", "form", "base"} & {t for t, _ in page.elements}
    names = [attributes["id"] for _, attributes in page.elements if "id" in attributes]
    assert len(set(names)) == len(names)
    for tag, attributes in page.elements:
        assert not [name for name in attributes if name.startswith("on")], attributes
        assert attributes.get("src", "data:image/").startswith("data:image/")
        assert "href" not in attributes or (attributes["href"][0] == "#" and attributes["href"][1:] in names)
        if tag == "img":
            assert attributes["alt"].strip()
        if tag == "th":
            assert attributes["scope"] in ("col", "row")
    assert len(page.all("caption")) == len(page.all("table"))
    return page
