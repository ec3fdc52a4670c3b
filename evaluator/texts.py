"""Small text files as editors and shells of any system write them."""

import codecs


def text_of(data: bytes) -> str:
    """Decode UTF-8, or UTF-16 that begins with its mark; without the mark. Raises `UnicodeDecodeError`.

    >>> text_of("τ".encode("utf-8-sig")), text_of("τ".encode("utf-16")), text_of("τ".encode())
    ('τ', 'τ', 'τ')
    """
    is_utf16 = data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    return data.decode("utf-16" if is_utf16 else "utf-8-sig")
