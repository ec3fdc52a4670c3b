"""The filters and tags of templates: `leaderboard.web.formatting` under the names that templates use."""

from django import template

from evaluator.counting import file_size
from evaluator.tables import escaping
from leaderboard.web import formatting

register = template.Library()

register.filter("grouped", formatting.grouped)
register.filter("counted", formatting.with_noun)
register.filter("size", file_size)
register.filter("duration", formatting.duration)
register.filter("ticked", formatting.ticked)
register.filter("paragraphs", formatting.paragraphs)
register.filter("joined", formatting.joined, is_safe=True)
register.filter("breakable", formatting.breakable)
register.filter("latex", escaping.latex)
register.filter("unbroken", formatting.unbroken, is_safe=True)
register.filter("jointed", formatting.jointed)
register.filter("with_whole_dates", formatting.with_whole_dates)
register.filter("lined", formatting.lined)
register.simple_tag(formatting.day)
register.simple_tag(formatting.moment)
register.simple_tag(formatting.second)
register.simple_tag(formatting.clock)
