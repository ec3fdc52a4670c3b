"""`manage.py make_seed_key`."""

from typing import Any

from django.core.management.base import BaseCommand

from leaderboard.storage import seeds


class Command(BaseCommand):
    help = (
        "Make the secret that the random weights and signs of hidden splits come from, beside the ground "
        "truth, if there is none. import_truth and open_edition --truth make it as well."
    )

    def handle(self, *args: Any, **options: Any) -> None:
        was_there = seeds.path().exists()
        seeds.ensure()
        self.stdout.write(f"{seeds.path()} {'was there already' if was_there else 'is made'}.")
