# SPDX-License-Identifier: Apache-2.0
"""Fails where a page of a folder links to a page or a place that there is not: check_links.py FOLDER"""

import html.parser
import pathlib
import sys
import urllib.parse


class Page(html.parser.HTMLParser):
    def __init__(self, path):
        super().__init__()
        self.places, self.links = set(), []
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag, attributes):
        for key, value in attributes:
            if value and (key == "id" or (tag == "a" and key == "name")):
                self.places.add(value)
            if value and key in ("href", "src"):
                self.links.append(value)


folder = pathlib.Path(sys.argv[1])
pages = {path.name: Page(path) for path in folder.glob("*.html")}
broken = set()
for name, page in pages.items():
    for link in page.links:
        if link == "#nested-classes":  # Doxygen's own, where the only nested classes are private
            continue
        target = urllib.parse.urlsplit(link)
        if target.scheme or target.netloc:
            continue
        path = urllib.parse.unquote(target.path) or name
        if not (folder / path).exists():
            broken.add(f"{name}: {link}: no such page")
        elif target.fragment and path in pages and urllib.parse.unquote(target.fragment) not in pages[path].places:
            broken.add(f"{name}: {link}: no such place in it")
for line in sorted(broken):
    print(line, file=sys.stderr)
if not pages:
    sys.exit(f"{folder}: no page")
print(f"{len(pages)} pages, {len(broken)} broken links")
sys.exit(1 if broken else 0)
