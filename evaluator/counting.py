"""A count and its noun, and the size of a file, wherever a sentence gives one."""


def counted(n: int, singular: str, plural: str = "") -> str:
    """The number with its noun; `plural` is the singular with an s unless given.

    >>> counted(1, "label"), counted(12, "label"), counted(2000, "entry", "entries")
    ('1 label', '12 labels', '2,000 entries')
    """
    return f"{n:,} {singular if n == 1 else plural or singular + 's'}"


def file_size(n_bytes: int) -> str:
    """Word a size in kB or whole MB, rounded up, so that a file over a limit never reads like one at it.

    >>> file_size(812), file_size(81_234), file_size(20_000_000), file_size(20_000_001)
    ('812 bytes', '82 kB', '20 MB', '20,001 kB')
    """
    if n_bytes < 1000:
        return counted(n_bytes, "byte")
    n_kilobytes = -(-n_bytes // 1000)
    return f"{n_kilobytes // 1000:,} MB" if n_kilobytes % 1000 == 0 else f"{n_kilobytes:,} kB"
