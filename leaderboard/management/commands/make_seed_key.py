"""`manage.py make_seed_key`."""

from typing import Any

from django.core.management.base import BaseCommand

from evaluator.counting import counted
from leaderboard.editions import ground_truth
from leaderboard.storage import seeds


class Command(BaseCommand):
    help = (
        "Make the secret that the random weights and signs of hidden splits come from, beside the ground "
        "truth, if there is none, and mark hidden ground truth from before there were marks. import_truth "
        "and open_edition --truth do both as well."
    )

    def handle(self, *args: Any, **options: Any) -> None:
        was_there = seeds.path().exists()
        seeds.ensure()
        self.stdout.write(f"{seeds.path()} {'was there already' if was_there else 'is made'}.")
        n_marked = ground_truth.mark_hidden()
        if n_marked:
            has = "has" if n_marked == 1 else "have"
            self.stdout.write(f"{counted(n_marked, 'hidden ground truth')} had no mark, and {has} one now.")
