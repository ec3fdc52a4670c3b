"""What the checks of the frame share."""

from pathlib import Path

import pytest


@pytest.fixture
def production(tmp_path: Path) -> dict[str, str]:
    """The environment of a production process; none of its services needs to exist for the checks."""
    return {
        "TSTTC_PROFILE": "production",
        "TSTTC_SECRET_KEY": "k" * 30 + "0123456789" * 3,
        "TSTTC_RECEIPT_KEY": "A" * 43,
        "TSTTC_ALLOWED_HOSTS": "board.example.org",
        "TSTTC_SITE_URL": "https://board.example.org",
        "TSTTC_DATABASE_URL": "postgres://tsttc:secret@127.0.0.1:1/tsttc",
        "TSTTC_BROKER_URL": "redis://127.0.0.1:1/0",
        "TSTTC_DATA_DIR": str(tmp_path),
    }
