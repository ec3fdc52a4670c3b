"""Names and texts that a person might give a method, a team, a file or a token to do harm with them."""

from itertools import product

FORMULAS = tuple(
    f"{start}{rest}"
    for start, rest in product(
        ("=", "+", "-", "@", "\t=", "\r=", " =", "＝", "＋", "＠", "'=", '"='),
        ("1+1", 'HYPERLINK("http://x.example","a")', "cmd|'/c calc'!A1"),
    )
)
# Where a spreadsheet splits lines at semicolons or tabs, a cell begins in the middle of a text.
SPLIT_FORMULAS = (
    "A;=WEBSERVICE('x')&A1;",
    "Csv;=1+1;",
    'Csv;"=1+1";',
    "Csv; @SUM(1)",
    "Csv;＝1+1",
)
MARKUP = (
    "<script>alert(1)</script>",
    "<img src=x onerror=alert(1)>",
    '"><svg onload=alert(1)>',
    '" autofocus onfocus=alert(1) x="',
    "<!--",
    "<![CDATA[",
    "</table></main>",
    "<a href=//x.example>",
    "<meta http-equiv=refresh content=0;url=//x.example>",
    "&lt;b&gt;",
    "{{ 7*7 }}",
    "{{ settings.SECRET_KEY }}",
    "%s%s%s%n",
    "{0.__class__}",
)
LATEX = (
    "a & b",
    "a % b",
    "a_b",
    "{a}",
    "}",
    "\\",
    "\\input{/etc/passwd}",
    "\\end{tabular}",
    "^^41",
    "a\\%b",
    "``quoted''",
)
MARKDOWN = (
    "a | b",
    "[a](http://x.example)",
    "![a](http://x.example/a.png)",
    "`a`",
    "a\\|b",
)
SQL = (
    "'; DROP TABLE leaderboard_score; --",
    "admin'--",
    "1); DELETE FROM leaderboard_team; --",
    "%' UNION SELECT NULL --",
)
PATHS = (
    "../../../../etc/passwd",
    "/etc/passwd",
    "..",
    "CON",
    "a/b",
    "a\\b",
    "%2e%2e%2f",
    "a\u2044b",
    'predictions".json',
    "a\r\nSet-Cookie: x=1",
    "a%0d%0aX: y",
)
INVISIBLE = tuple(
    f"Foo{character}Bar"
    for character in (
        *("\u202e", "\u202d", "\u2066", "\u2067", "\u2069", "\u200e", "\u200f", "\u061c"),
        *("\u200b", "\u200c", "\u200d", "\u2060", "\ufeff", "\u00ad", "\u180e", "\u034f"),
        *("\u2028", "\u2029", "\u0085", "\u00a0", "\u3000", "\u115f", "\u3164", "\uffa0"),
        *("\ufff9", "\ufffc", "\ufffd", "\ufffe", "\uffff", "\U000e0041", "\U000e0001", "\U0010ffff"),
    )
)
CONTROL = tuple(f"Foo{chr(code)}Bar" for code in (0, 1, 7, 8, 9, 10, 11, 12, 13, 27, 31, 127, 128, 155, 159))
BROKEN = ("\ud800", "\udfff", "Foo\ud83d", "\ude00Foo", "\udc00\ud800", "Foo\udcff")
EMOJI = ("🦉", "👩‍👩‍👧‍👦", "🇪🇺", "👍🏿", "🏴\U000e0067\U000e0062\U000e007f", "☠️", "1️⃣")
SCRIPTS = (
    "عربي",
    "日本語",
    "हिन्दी",
    "Кириллица",
    "𝔉𝔬𝔬",
    "ﬃ",
    "Å",
    "A\u030a",
    "Z" + "\u0300" * 60,
    "o\u0338\u0334" * 20,
    "Fοο",  # Greek
    "Fоо",  # Cyrillic
    "İ",
    "ß",
    "K",
)
NOTHING = ("", " ", "\t", "\u3000", "\u200b", "\u00a0", "\n", "  \u2003 ")
WORDS = (
    "null",
    "None",
    "NaN",
    "1e999",
    "Anonymous 3f9c2a",
    "admin",
)
LONG = (
    "x" * 80,
    "x" * 81,
    "x" * 10_000,
    "🦉" * 80,
    "é" * 81,
    "x " * 5_000,
    "<" * 500,
    "&" * 80,
    "\u202e" * 200,
)

NAMES: tuple[str, ...] = (
    *FORMULAS,
    *SPLIT_FORMULAS,
    *MARKUP,
    *LATEX,
    *MARKDOWN,
    *SQL,
    *PATHS,
    *INVISIBLE,
    *CONTROL,
    *BROKEN,
    *EMOJI,
    *SCRIPTS,
    *NOTHING,
    *WORDS,
    *LONG,
)
