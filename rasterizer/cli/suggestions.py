"""What somebody probably meant who wrote a word that isn't there."""

# Flags of other programs, by which people call ours.
_HABITS = {
    "--bg": "--background", "--background-color": "--background", "--width": "--size", "--height": "--size",
    "--resolution": "--size", "--res": "--size", "--dimensions": "--size", "--out": "--output", "--outfile": "--output",
    "--aa": "--samples", "--msaa": "--samples", "--supersample": "--samples", "--anti-aliasing": "--samples",
    "--smooth": "--shading", "--camera-position": "--eye", "--position": "--eye", "--look-at": "--target",
    "--orthographic": "--ortho", "--perspective": "--fov", "--elev": "--elevation", "--azim": "--azimuth",
    "--jobs": "--threads", "--workers": "--threads", "--silent": "--quiet", "--format": "--input-format",
}  # fmt: skip


def did_you_mean(word: str, legal) -> str:
    """Return "; did you mean X?" with the nearest of the legal words, or nothing where none is near."""
    near = _nearest(word, list(legal))
    return f"; did you mean {near}?" if near else ""


def nearest_flag(words, flags) -> str:
    """Return the same for the first of some words that is no flag; flags of other programs are known, too."""
    for word in words:
        name = word.partition("=")[0]
        if name.startswith("-"):
            habit = _HABITS.get(name.lower())
            return f"; did you mean {habit}?" if habit in flags else did_you_mean(name, flags)
    return ""


def _nearest(word, legal) -> str | None:
    """The legal word that is alike but for its case, begins like the word, or has most letters in common with it."""
    import difflib

    letters = word.lower().lstrip("-")
    bare = {each.lower().lstrip("-"): each for each in legal if len(each.lstrip("-")) > 1}
    if letters in bare:
        return bare[letters]
    begun = [each for name, each in bare.items() if len(letters) >= 3 and name.startswith(letters)]
    near = begun or [bare[name] for name in difflib.get_close_matches(letters, bare, n=1)]
    return near[0] if near else None
