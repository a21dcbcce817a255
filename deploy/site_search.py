"""A hook of mkdocs (mkdocs.yml): makes the Japanese pages searchable.

Debian's mkdocs has no Japanese for its search, while the theme has. And the search takes words to be parted by spaces,
which Japanese is not. So a zero-width space goes where kanji, hiragana and katakana meet: most words begin or end there.
"""
import json
import pathlib
import re

KINDS = "[ぁ-ん]", "[ァ-ヶー]", "[一-龠々]"
MEETING = re.compile("|".join(f"(?<={one})(?={other})" for one in KINDS for other in KINDS if one != other))


def on_post_build(config, **_):
    file = pathlib.Path(config["site_dir"]) / "search/search_index.json"
    index = json.loads(file.read_text("utf-8"))
    index["config"].update(lang=["en", "ja"], separator=r"[\s\-\u200b、。（）「」：]+")
    for entry in index["docs"]:
        for key in ("title", "text"):
            entry[key] = MEETING.sub("\u200b", entry[key])
    file.write_text(json.dumps(index, ensure_ascii=False), "utf-8")
