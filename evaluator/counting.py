"""A count and its noun, wherever a sentence gives one."""


def counted(n: int, singular: str, plural: str = "") -> str:
    """The number with its noun; `plural` is the singular with an s unless given.

    >>> counted(1, "label"), counted(12, "label"), counted(2000, "entry", "entries")
    ('1 label', '12 labels', '2,000 entries')
    """
    return f"{n:,} {singular if n == 1 else plural or singular + 's'}"
