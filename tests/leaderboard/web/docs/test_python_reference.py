"""The reference of the Python packages has every public name, as it is."""

import inspect
import re
from typing import Final, get_args

import evaluator
from evaluator.metrics.protocol import DEFAULT_PROTOCOL, ProtocolName
from evaluator.predictions.documents import Unit
from evaluator.scoring.breakdown import GroupName
from evaluator.scoring.differences import N_SIGN_FLIPS, PUBLISHED_DECIMALS
from evaluator.scoring.significance import P_CLASSES
from evaluator.truth.ground_truth import KeyKind
from evaluator.units import UnitKind
from leaderboard.web.docs import guides, python_reference

TEXTS = {name: python_reference.text(name) for name in python_reference.SECTIONS}
TEXT = "\n".join(TEXTS.values())
GUIDE = guides.files()["python-reference"].read_text(encoding="utf-8")
OF_PYTHON: Final = {
    *("Any", "Callable", "IO", "Iterable", "Iterator", "Literal", "Mapping", "None", "Path", "Sequence"),
    *("False", "NDArray", "True"),
}
LITERALS: Final = {
    "ProtocolName": ProtocolName,
    "UnitKind": UnitKind,
    "KeyKind": KeyKind,
    "Unit": Unit,
    "GroupName": GroupName,
}
ENTRIES = dict(re.findall(r"^### ([\w.]+)(?:\(\))?\n(.*?)(?=^##|\Z)", TEXT, re.MULTILINE | re.DOTALL))


def test_every_public_name_is_there_with_words() -> None:
    expected = {f"evaluator.{name}" for name in evaluator.__all__ if name != "__version__"}
    assert re.findall(r"^- \*\*`\w+`\*\*(?:`[^`]*`)?(?::|\\\n) *\n", TEXT, re.MULTILINE) == []
    for sections in python_reference.SECTIONS.values():
        for modules in sections.values():
            expected |= {f"{module}.{name}" for module, names in modules.items() for name in names}
    assert set(ENTRIES) == expected
    words = {
        name: re.sub(r"```.*?```", "", entry, flags=re.DOTALL).strip() for name, entry in ENTRIES.items()
    }
    assert [name for name, text in words.items() if not text] == []


def test_arguments_are_those_of_the_function() -> None:
    signature = inspect.signature(evaluator.write_predictions)
    shown = ENTRIES["evaluator.write_predictions"]
    assert re.findall(r"^    (\w+):", shown, re.MULTILINE) == list(signature.parameters)
    assert "    ttc_s: ArrayLike | None = None,\n" in shown
    assert f"| `DEFAULT_PROTOCOL` | the protocol `{DEFAULT_PROTOCOL}` |" in GUIDE
    assert f"| `N_SIGN_FLIPS` | {N_SIGN_FLIPS:,} |" in GUIDE
    assert f"| `PUBLISHED_DECIMALS` | {PUBLISHED_DECIMALS} |" in GUIDE
    assert f"| `P_CLASSES` | {P_CLASSES[0]}, {P_CLASSES[1]} and {P_CLASSES[2]} |" in GUIDE
    for name, literal in LITERALS.items():
        row = re.search(rf"^\| `{name}` \| (.*) \|$", GUIDE, re.MULTILINE)
        assert row
        assert re.findall(r'"([\w-]+)"', row[1]) == list(get_args(literal))
    assert "timeout_s: float = 15.0,\n    retry_policy: RetryPolicy = …," in ENTRIES["evaluator.Client"]


def test_a_function_differs_from_a_class() -> None:
    assert "### evaluator.evaluate()\n" in TEXT
    assert "### evaluator.Manifest\n\n```text\nclass Manifest(" in TEXT


def test_each_page_has_its_reference_and_all_names_are_linked() -> None:
    anchors = set()
    for name, sections in python_reference.SECTIONS.items():
        page = guides.guide(name)
        assert [heading.text for heading in page.chapters] == list(sections)
        anchors |= {f"{name}.md#{part.heading.anchor}" for part in page.parts}
    links = set(re.findall(r"\]\((\S+\.md#[\w-]+)\)", TEXT))
    assert len(links) == len(ENTRIES)
    assert links <= anchors


def test_every_type_and_constant_in_a_signature_is_explained() -> None:
    signatures = "\n".join(re.findall(r"```text\n(?:def|class) (?:.*?)```|\*\*`\([^`]*`", TEXT, re.DOTALL))
    named = set(re.findall(r"(?<![\w.'\"])[A-Z]\w+(?![\w'\".])", signatures))
    words = "".join(guides.files()[name].read_text(encoding="utf-8") for name in TEXTS)
    explained = set(re.findall(r"`(\w+)`", words)) | {name.rpartition(".")[2] for name in ENTRIES}
    assert named - explained - OF_PYTHON == set()


def test_a_type_links_to_the_class_of_its_own_package() -> None:
    assert "#tsttc_baselinesmethodsmethod)" in ENTRIES["tsttc_baselines.running.run_method"]
    assert "#evaluatorclientanswersmethod)" not in ENTRIES["tsttc_baselines.running.run_method"]
