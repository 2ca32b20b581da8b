"""The changelog: each release and the unreleased part with a date, the newest first; no effect comes twice."""

import re

from helpers.pages import text_of

from rasterizer.version import __version__

PAGE = "CHANGELOG.md"


def test_every_release_has_a_date_and_the_newest_is_on_top():
    releases = re.findall(r"^## (.+)$", text_of(PAGE), re.MULTILINE)
    dated = [re.fullmatch(r"(Unreleased|\d+\.\d+\.\d+), (\d{4}-\d\d-\d\d)", title) for title in releases]
    assert all(dated), releases
    dates = [match[2] for match in dated]
    assert dates == sorted(dates, reverse=True)
    assert __version__ in [match[1] for match in dated]


def test_no_chapter_and_no_effect_comes_twice():
    for release in re.split(r"^## ", text_of(PAGE), flags=re.MULTILINE)[1:]:
        chapters = re.findall(r"^### (.+)$", release, re.MULTILINE)
        entries = re.findall(r"^- (.*(?:\n  .*)*)", release, re.MULTILINE)
        assert len(chapters) == len(set(chapters)) and len(entries) == len(set(entries))
        sentences = [sentence for entry in entries for sentence in re.split(r"[;.:] ", " ".join(entry.split()))]
        twice = {each for each in sentences if len(each) > 30 and sentences.count(each) > 1}
        assert not twice


def test_it_tells_of_effects_and_not_of_the_work():
    internal = re.findall(r"\b(?:tests/|helpers/|refactor\w*|\.ci/|pytest|mypy|lint)\S*", text_of(PAGE))
    assert not internal
