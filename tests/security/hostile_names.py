"""Names and texts that somebody might give a method, a team, a file or a token to do harm with them."""

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
    "</title><script>alert(1)</script>",
    "<img src=x onerror=alert(1)>",
    '"><svg onload=alert(1)>',
    "'><b onmouseover=alert(1)>",
    '" autofocus onfocus=alert(1) x="',
    "javascript:alert(1)",
    "<!--",
    "]]>",
    "<![CDATA[",
    "</textarea>",
    "</table></main>",
    "<style>*{display:none}</style>",
    "<a href=//x.example>",
    "<base href=//x.example>",
    "<meta http-equiv=refresh content=0;url=//x.example>",
    "&lt;b&gt;",
    "&#x3C;script&#x3E;",
    "&amp;amp;",
    "{{ 7*7 }}",
    "{% include 'base.html' %}",
    "{{ settings.SECRET_KEY }}",
    "${7*7}",
    "#{7*7}",
    "<%= 7*7 %>",
    "%s%s%s%n",
    "%(name)s",
    "{0.__class__}",
)
LATEX = (
    "a & b",
    "a % b",
    "$x$",
    "a_b",
    "a^b",
    "a#b",
    "a~b",
    "{a}",
    "}",
    "{",
    "\\",
    "\\\\",
    "\\input{/etc/passwd}",
    "\\write18{rm -rf /}",
    "\\end{tabular}",
    "\\immediate\\openout1=x",
    "^^41",
    "a\\%b",
    "<<>>",
    "``quoted''",
)
MARKDOWN = (
    "a | b",
    "|",
    "[a](http://x.example)",
    "![a](http://x.example/a.png)",
    "`a`",
    "*a*",
    "# a",
    "a\\|b",
)
SQL = (
    "'; DROP TABLE leaderboard_score; --",
    "' OR '1'='1",
    "admin'--",
    '" OR ""="',
    "1); DELETE FROM leaderboard_team; --",
    "\\'; SELECT pg_sleep(9); --",
    "%' UNION SELECT NULL --",
    "_%",
)
PATHS = (
    "../../../../etc/passwd",
    "..\\..\\windows\\win.ini",
    "/etc/passwd",
    "C:\\boot.ini",
    "~/.ssh/id_rsa",
    ".",
    "..",
    "...",
    "CON",
    "NUL.json",
    "a/b",
    "a\\b",
    "file:///etc/passwd",
    "%2e%2e%2f",
    "a;b",
    "a\u2044b",
    "predictions.json;.exe",
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
    "עברית",
    "日本語",
    "한국어",
    "ไทย",
    "हिन्दी",
    "Ελληνικά",
    "Кириллица",
    "Ꭰ",
    "𝔉𝔬𝔬",
    "ﬃ",
    "ﷺ",
    "Å",
    "A\u030a",
    "Z" + "\u0300" * 60,
    "o\u0338\u0334" * 20,
    "Fοο",  # Greek
    "Fоо",  # Cyrillic
    "ＦＯＯ",
    "ℱoo",
    "ı",
    "İ",
    "ß",
    "ſ",
    "K",
)
NOTHING = ("", " ", "\t", "\u3000", "\u200b", "\u00a0", "\n", "  \u2003 ")
WORDS = (
    "null",
    "None",
    "undefined",
    "NaN",
    "true",
    "0",
    "-1",
    "1e999",
    "Anonymous",
    "Anonymous 3f9c2a",
    "admin",
    "maintain",
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
