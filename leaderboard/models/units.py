"""The unit of an edition's confidence intervals, tests and rank ranges."""

from typing import Any

from django.db import models

from evaluator.units import DAY, GIVEN, KINDS, RECORDING, in_words, noun_of


class UnitOfInference(models.Model):
    unit = models.CharField(
        max_length=12,
        choices=[(kind, kind) for kind in KINDS],
        default=RECORDING,
        help_text="What its intervals, tests and rank ranges take as independent; set when it was opened.",
    )
    n_units = models.PositiveIntegerField(
        null=True, blank=True, help_text="How many; null: as many as its ground truth has recordings."
    )
    ground_truth: Any

    class Meta:
        abstract = True
        constraints = [
            models.CheckConstraint(
                condition=models.Q(unit=RECORDING, n_units=None)
                | models.Q(unit__in=[DAY, GIVEN], n_units__isnull=False),
                name="edition_unit_is_known",
            ),
        ]

    @property
    def unit_count(self) -> int:
        return int(self.ground_truth.n_recordings if self.n_units is None else self.n_units)

    @property
    def unit_noun(self) -> str:
        return noun_of(self.unit)

    @property
    def units(self) -> str:
        return in_words(self.unit, self.unit_count)
