"""Options that take several words, as people write them: `--truth A B C`."""

from __future__ import annotations

from collections.abc import Collection, Sequence


def spread(words: Sequence[str], options: Collection[str]) -> list[str]:
    """Return a command line in which such an option stands before each of its words.

    >>> spread(["run", "--truth", "a", "b", "--json"], ("--truth",))
    ['run', '--truth', 'a', '--truth', 'b', '--json']
    """
    found: list[str] = []
    option = ""
    for word in words:
        if word.startswith("-"):
            option = word if word in options else ""
            found += [] if option else [word]
        else:
            found += [option, word] if option else [word]
    return found
