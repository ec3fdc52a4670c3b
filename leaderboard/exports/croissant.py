"""The manifest of an edition as Croissant 1.1, which programs of machine learning find and load data by.

The format: https://docs.mlcommons.org/croissant/docs/croissant-spec-1.1.html. True values are no part of it.
"""

import hashlib
from typing import Any, Final

from django.conf import settings
from django.urls import reverse

from leaderboard.models import Edition
from leaderboard.storage import files

CONFORMS_TO: Final = "http://mlcommons.org/croissant/1.1"
MEDIA_TYPE: Final = f'application/ld+json; profile="{CONFORMS_TO}"'
# Those of the specification's context that a document of one table uses.
_TERMS: Final = ("citeAs", "column", "extract", "field", "fileObject", "key", "recordSet", "source")
_FILE: Final = "manifest.csv"
_SEQUENCES: Final = "sequences"
# By column: type and meaning. Ids are text: a camera "01" is not camera 1.
_COLUMNS: Final = {
    "anno_id": ("sc:Integer", "Number of the sequence in this manifest."),
    "bag_stamp": ("sc:Text", "Recording that the sequence is from."),
    "cam_id": ("sc:Text", "Camera."),
    "ts": ("sc:Integer", "Time of the target frame in nanoseconds."),
    "track_id": ("sc:Text", "Track of the object within the recording."),
    "unit": ("sc:Text", "What confidence intervals take as independent."),
}


def document(edition: Edition) -> dict[str, Any]:
    """Describe the manifest of a published edition as a dataset with one table. Raises `OSError`."""
    split, benchmark, paper = edition.split, settings.BENCHMARK, settings.BENCHMARK.paper
    name = files.manifest_name(edition.ground_truth.manifest_digest)
    with files.answering(), files.open_named(name) as file:
        columns = file.readline().decode().rstrip("\n").split(",")
        file.seek(0)
        # Not the digest of the manifest, which is of its rows in the order of anno_id.
        digest = hashlib.file_digest(file, "sha256").hexdigest()
    assert edition.published_at is not None  # noqa: S101 - for the type checker: it is published
    address = f"{settings.SITE_URL}{reverse('manifest', args=[split.pk])}?edition={edition.number}"
    return {
        "@context": {
            "@language": "en",
            "@vocab": "https://schema.org/",
            "sc": "https://schema.org/",
            "cr": "http://mlcommons.org/croissant/",
            "dct": "http://purl.org/dc/terms/",
            "conformsTo": "dct:conformsTo",
            "dataType": {"@id": "cr:dataType", "@type": "@vocab"},
            **{term: f"cr:{term}" for term in _TERMS},
        },
        "@type": "sc:Dataset",
        "conformsTo": CONFORMS_TO,
        "name": f"{benchmark.name}-{split.pk}-manifest",
        "description": f"{split.title}: the sequences of a prediction file. {split.description}".strip(),
        "version": f"{edition.number}.0.0",
        "datePublished": f"{edition.published_at:%Y-%m-%d}",
        "url": settings.SITE_URL + reverse("edition", args=[split.pk, edition.number]),
        "license": settings.SITE_URL + reverse("site_page", args=["licence"]),
        "keywords": list(benchmark.keywords),
        "creator": [{"@type": "sc:Person", "name": name} for name in paper.authors]
        if paper
        else {"@type": "sc:Organization", "name": benchmark.site_name},
        "citeAs": paper.bibtex_entry if paper else benchmark.dataset.url,
        "distribution": [
            {
                "@type": "cr:FileObject",
                "@id": _FILE,
                "name": _FILE,
                "contentUrl": address,
                "encodingFormat": "text/csv",
                "sha256": digest,
            }
        ],
        "recordSet": [
            {
                "@type": "cr:RecordSet",
                "@id": _SEQUENCES,
                "name": _SEQUENCES,
                "key": {"@id": f"{_SEQUENCES}/anno_id"},
                "field": [
                    {
                        "@type": "cr:Field",
                        "@id": f"{_SEQUENCES}/{column}",
                        "name": column,
                        "description": _COLUMNS[column][1],
                        "dataType": _COLUMNS[column][0],
                        "source": {"fileObject": {"@id": _FILE}, "extract": {"column": column}},
                    }
                    for column in columns
                ],
            }
        ],
    }
