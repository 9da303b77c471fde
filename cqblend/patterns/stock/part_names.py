"""Names of the parts of split pieces and labels of divided seams: the old one with letters behind it, each once.

Depends on nothing else in cqblend.
"""

from collections import defaultdict
from collections.abc import Collection, Sequence
from itertools import count, islice
from string import ascii_uppercase


def make_cut_labels(number: int, taken: Collection[str]) -> list[str]:
    """Return so many labels for seams along cuts, none of which is taken.

    Examples
    --------
    >>> make_cut_labels(2, {"C1", "7"})
    ['C2', 'C3']
    """
    return list(islice((label for k in count(1) if (label := f"C{k}") not in taken), number))


def add_letters(stem: str, number: int, taken: Collection[str]) -> list[str]:
    """Return so many words, none of which is taken: the stem with one letter behind it, then with two, and so on.

    Examples
    --------
    >>> add_letters("3", 3, {"3B"})
    ['3A', '3C', '3D']
    """
    found: list[str] = []
    stems = [stem]
    while len(found) < number:
        stems = [stem + letter for stem in stems for letter in ascii_uppercase]
        found.extend([word for word in stems if word not in taken][: number - len(found)])
    return found


def reletter_names(names: Sequence[str], stems: Collection[str]) -> list[str]:
    """Return names that were lettered again and again with the letters of one division; others as labels of cuts.

    A name is lettered if it is one of the stems followed by letters. The order of the names stays.

    Examples
    --------
    >>> reletter_names(["1AA", "1AB", "1B", "C1AA", "2"], {"1", "2"})
    ['1A', '1B', '1C', 'C1', '2']
    """
    groups: dict[str | None, list[int]] = defaultdict(list)
    for k, name in enumerate(names):
        heads = (name[:n] for n in range(len(name), 0, -1))
        groups[next((h for h in heads if h in stems and not name[len(h) :].strip(ascii_uppercase)), None)].append(k)
    found = list(names)
    taken = set(stems)
    for stem, members in groups.items():
        if stem is None:
            fresh = make_cut_labels(len(members), taken)
        else:
            fresh = [stem] if len(members) == 1 else add_letters(stem, len(members), taken)
        taken.update(fresh)
        for k, name in zip(members, fresh, strict=True):
            found[k] = name
    return found
