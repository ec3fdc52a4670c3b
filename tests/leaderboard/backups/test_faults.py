"""One bad file of the site stops no backup: it is named, all else is saved, and no good copy is lost."""

import errno
import fcntl
import os
from pathlib import Path

import pytest
from django.conf import settings as configured
from django.core.management import CommandError, call_command
from django.test import Client
from django.utils import timezone

from leaderboard.backups import backup, contents, copies
from leaderboard.backups.contents import Contents, NoBackup
from leaderboard.models import AuditEvent, BackupRun, Edition, LostFile, Submission, User
from leaderboard.ops import backup_runs
from leaderboard.storage import files, hidden_marks, seeds, truth_values
from tests import builders
from tests.leaderboard.ops.test_prometheus import figures

pytestmark = [pytest.mark.django_db(transaction=True)]


@pytest.fixture
def sent(edition: Edition, owner: User) -> list[Submission]:
    """Two scored files."""
    made = [
        builders.submit(owner, builders.predictions(edition, factor=f), method=f"M{f}") for f in (1.1, 1.2)
    ]
    builders.score_all()
    return made


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return tmp_path / "backup"


def stored(submission: Submission) -> Path:
    return Path(configured.FILES_DIR, files.predictions_name(submission.digest))


def copied(folder: Path, submission: Submission) -> Path:
    return folder / contents.FILES / files.predictions_name(submission.digest)


def damage(path: Path) -> None:
    data = path.read_bytes()
    path.write_bytes(data[:-9] + bytes(byte ^ 1 for byte in data[-9:]))


def replace_by_a_folder(path: Path) -> None:
    path.unlink()
    path.mkdir()


def replace_by_what_fails_to_read(path: Path) -> None:
    path.unlink()
    path.symlink_to("/proc/self/mem")


def replace_by_a_loop(path: Path) -> None:
    path.unlink()
    path.symlink_to(path)


def make(folder: Path) -> Contents:
    return backup.make(into=str(folder), now=timezone.now())


HARM = {
    "damaged": (damage, "is damaged: its content has the digest"),
    "folder": (replace_by_a_folder, "cannot be read on the site: Is a directory"),
    "read error": (replace_by_what_fails_to_read, "cannot be read on the site: Input/output error"),
    "loop": (replace_by_a_loop, "cannot be read on the site: Too many levels"),
    "gone": (Path.unlink, "is missing on the site"),
}


@pytest.mark.parametrize("harm", HARM)
def test_a_bad_file_is_named_and_all_others_and_the_tables_are_saved(
    sent: list[Submission], folder: Path, harm: str
) -> None:
    act, reason = HARM[harm]
    bad, good = sent
    act(stored(bad))
    with pytest.raises(CommandError, match=r"The backup is there, with the whole database, but") as raised:
        call_command("backup", str(folder))
    name = files.predictions_name(bad.digest)
    assert f"{name} {reason}" in str(raised.value)
    made = Contents.read(folder)
    assert list(made.faults) == [name]
    assert name not in made.files
    assert not copied(folder, bad).exists()
    assert copied(folder, good).read_bytes() == stored(good).read_bytes()
    assert contents.digest_at(folder / made.database) == made.database_sha256
    assert made.ground_truth
    run = BackupRun.objects.get()
    assert (run.is_ok, run.n_damaged) == (False, 1)
    assert run.fault.strip().startswith(name)


@pytest.mark.parametrize("harm", HARM)
def test_a_good_copy_outlives_its_file(sent: list[Submission], folder: Path, harm: str) -> None:
    act, reason = HARM[harm]
    assert make(folder).faults == {}
    before = copied(folder, sent[0]).read_bytes()
    act(stored(sent[0]))
    made = make(folder)
    name = files.predictions_name(sent[0].digest)
    assert list(made.faults) == [name]
    assert made.faults[name].startswith(reason)
    assert made.faults[name].endswith("; the backup keeps its good copy")
    assert name in made.files
    assert copied(folder, sent[0]).read_bytes() == before


def test_a_file_that_was_mended_replaces_what_the_backup_has(sent: list[Submission], folder: Path) -> None:
    good = stored(sent[0]).read_bytes()
    damage(stored(sent[0]))
    assert make(folder).faults
    stored(sent[0]).write_bytes(good)
    made = make(folder)
    assert made.faults == {}
    assert copied(folder, sent[0]).read_bytes() == good
    assert not backup_runs.failed_since_good(now=timezone.now()).exists()


def test_a_damaged_copy_is_noticed_and_replaced(sent: list[Submission], folder: Path) -> None:
    make(folder)
    copy = copied(folder, sent[1])
    status = copy.stat()
    damage(copy)
    os.utime(copy, ns=(status.st_atime_ns, status.st_mtime_ns))
    assert make(folder).faults == {}
    assert copy.read_bytes() == stored(sent[1]).read_bytes()


def private(edition: Edition) -> dict[str, Path]:
    digest = edition.ground_truth_id
    return {
        "values": truth_values.values_path(digest),
        "manifest": truth_values.manifest_path(digest),
        "mark": hidden_marks.path(digest),
        "secret": seeds.path(),
    }


@pytest.mark.parametrize("kind", ["values", "manifest", "mark", "secret"])
def test_what_is_lost_of_the_ground_truth_is_named_and_stays_in_the_backup(
    edition: Edition, folder: Path, kind: str
) -> None:
    path = private(edition)[kind]
    made = make(folder)
    before = (folder / contents.GROUND_TRUTH / path.name).read_bytes()
    path.unlink()
    again = make(folder)
    assert again.ground_truth == made.ground_truth
    assert list(again.faults) == [f"ground-truth/{path.name}"]
    assert (folder / contents.GROUND_TRUTH / path.name).read_bytes() == before


@pytest.mark.parametrize("kind", ["values", "manifest", "secret"])
def test_damage_of_the_ground_truth_does_not_reach_the_backup(
    edition: Edition, folder: Path, kind: str
) -> None:
    path = private(edition)[kind]
    make(folder)
    before = (folder / contents.GROUND_TRUTH / path.name).read_bytes()
    path.write_bytes(path.read_bytes()[:20])
    again = make(folder)
    assert "is damaged" in again.faults[f"ground-truth/{path.name}"]
    assert (folder / contents.GROUND_TRUTH / path.name).read_bytes() == before


def test_another_secret_replaces_the_former_one_which_stays_beside_it(edition: Edition, folder: Path) -> None:
    make(folder)
    before = seeds.path().read_text()
    seeds.path().unlink()
    seeds.ensure()
    assert make(folder).faults == {}
    copy = folder / contents.GROUND_TRUTH / seeds.path().name
    assert copy.read_text() == seeds.path().read_text()
    [aside] = copy.parent.glob("seed.key.until-*")
    assert aside.read_text() == before


def test_a_damaged_manifest_of_the_store_is_named(sent: list[Submission], folder: Path) -> None:
    name = files.manifest_name(sent[0].manifest_digest)
    damage(Path(configured.FILES_DIR, name))
    assert "is damaged" in make(folder).faults[name]


def test_values_that_workers_make_again_are_no_loss(sent: list[Submission], folder: Path) -> None:
    for path in Path(configured.FILES_DIR, "aligned").rglob("*.f8"):
        damage(path)
    made = make(folder)
    assert made.faults == {}
    assert [name for name in made.files if name.startswith("aligned/")] == []


def test_files_of_others_in_the_folder_stay_and_do_no_harm(sent: list[Submission], folder: Path) -> None:
    folder.mkdir()
    others = [folder / "changes.csv", folder / "database-notes" / "a.txt", folder / "files" / "b.txt"]
    for path in others:
        path.parent.mkdir(exist_ok=True)
        path.write_text("mine")
    for _ in range(2):
        assert make(folder).faults == {}
    assert [path.read_text() for path in others] == ["mine"] * 3
    assert len(list(folder.glob("database-2*"))) == 1


@pytest.mark.parametrize("name", ["predictions", "manage.py", "leaderboard.sqlite3", "seed.key"])
def test_a_folder_that_is_plainly_another_thing_is_refused(db: None, folder: Path, name: str) -> None:
    (folder / name).mkdir(parents=True)
    with pytest.raises(NoBackup, match=f"holds '{name}': it is "):
        make(folder)
    assert [path.name for path in folder.iterdir()] == [name]
    assert "expected a folder of backups" in BackupRun.objects.get().fault


def test_a_link_that_leads_to_the_store_is_refused(sent: list[Submission], folder: Path) -> None:
    folder.mkdir()
    (folder / contents.FILES).symlink_to(configured.FILES_DIR)
    with pytest.raises(NoBackup, match="lie in each other"):
        make(folder)


def test_two_backups_at_once_into_one_folder_are_refused(sent: list[Submission], folder: Path) -> None:
    make(folder)
    with backup._alone_in(folder), pytest.raises(NoBackup, match="Another backup is being written"):
        make(folder)
    assert make(folder).faults == {}


def test_a_file_system_without_locks_is_no_obstacle(
    sent: list[Submission], folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(handle: int, operation: int) -> None:
        raise OSError(errno.EBADF, "Bad file descriptor")

    monkeypatch.setattr(fcntl, "flock", refuse)
    assert make(folder).faults == {}


def test_a_store_that_does_not_answer_costs_a_few_questions_and_the_tables_are_saved(
    sent: list[Submission], folder: Path
) -> None:
    asked = []

    class Silent:
        def open(self, name: str, mode: str) -> None:
            asked.append(name)
            raise files.StoreUnavailable(5, "the file store does not answer")

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(files, "store", Silent)
        reader = copies.StoreReader()
        for number in range(20):
            copy = copies.keep_stored(folder, f"predictions/ab/{number:064x}.json", former="", reader=reader)
            assert copy.fault == "cannot be read on the site: the file store does not answer"
    assert len(asked) == 3


def test_a_backup_that_cannot_be_made_is_recorded_with_its_reason(db: None, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(CommandError, match="is a file; expected a folder"):
        call_command("backup", str(tmp_path / "file"))
    [failed] = backup_runs.failed_since_good(now=timezone.now())
    assert "is a file" in failed.fault


def test_a_list_of_the_former_form_is_read(sent: list[Submission], folder: Path) -> None:
    make(folder)
    text = (folder / contents.LIST).read_text()
    former = text.replace('"format": 4', '"format": 3').replace(
        '"faults": {}', '"missing": ["manifests/ab.csv"]'
    )
    (folder / contents.LIST).write_text(former)
    assert Contents.read(folder).faults == {"manifests/ab.csv": "is missing on the site"}
    assert make(folder).faults == {}


def acknowledge(*names: str) -> None:
    call_command("acknowledge_loss", *names, "--reason", "the disk is gone")


def name_of(submission: Submission) -> str:
    return files.predictions_name(submission.digest)


@pytest.mark.parametrize("harm", HARM)
def test_of_two_lost_files_the_acknowledged_one_is_no_fault_any_more(
    sent: list[Submission], folder: Path, harm: str
) -> None:
    first, second = map(name_of, sent)
    for submission in sent:
        HARM[harm][0](stored(submission))
    assert set(make(folder).faults) == {first, second}
    acknowledge(first)
    made = make(folder)
    assert (set(made.faults), set(made.known_lost)) == ({second}, {first})
    assert backup_runs.last_good() is None
    acknowledge(second)
    made = make(folder)
    assert (made.faults, set(made.known_lost)) == ({}, {first, second})
    good = backup_runs.last_good()
    assert good is not None
    assert (good.n_lost, good.n_damaged) == (2, 0)
    assert not backup_runs.failed_since_good(now=timezone.now()).exists()
    assert Contents.read(folder).known_lost == made.known_lost


def test_what_is_lost_of_the_ground_truth_is_acknowledged_as_well(edition: Edition, folder: Path) -> None:
    values, manifest = (private(edition)[kind] for kind in ("values", "manifest"))
    for path in (values, manifest):
        path.unlink()
    acknowledge(f"ground-truth/{values.name}")
    made = make(folder)
    assert list(made.known_lost) == [f"ground-truth/{values.name}"]
    assert list(made.faults) == [f"ground-truth/{manifest.name}"]


def test_an_acknowledged_file_that_came_back_is_saved_and_its_next_loss_is_a_fault(
    sent: list[Submission], folder: Path
) -> None:
    content = [stored(submission).read_bytes() for submission in sent]
    for submission in sent:
        stored(submission).unlink()
    acknowledge(*map(name_of, sent))
    assert make(folder).faults == {}
    stored(sent[0]).write_bytes(content[0])
    made = make(folder)
    assert name_of(sent[0]) in made.files
    assert list(made.known_lost) == [name_of(sent[1])]
    stored(sent[0]).unlink()
    assert list(make(folder).faults) == [name_of(sent[0])]


def test_a_file_of_which_the_backup_has_a_good_copy_stays_a_fault(
    sent: list[Submission], folder: Path
) -> None:
    make(folder)
    stored(sent[0]).unlink()
    acknowledge(name_of(sent[0]))
    made = make(folder)
    assert made.known_lost == {}
    assert made.faults[name_of(sent[0])].endswith("the backup keeps its good copy")


def test_only_a_needed_file_that_is_lost_is_acknowledged_and_of_two_names_none_if_one_is_refused(
    sent: list[Submission],
) -> None:
    stored(sent[0]).unlink()
    for other, sentence in {
        name_of(sent[1]): "is there and undamaged",
        "predictions/ab/none.json": "The site needs no file",
        "../../etc/passwd": "The site needs no file",
    }.items():
        with pytest.raises(CommandError, match=sentence):
            acknowledge(name_of(sent[0]), other)
    seeds.path().unlink()
    with pytest.raises(CommandError, match="make_seed_key"):
        acknowledge("ground-truth/seed.key")
    assert not LostFile.objects.exists()
    acknowledge(name_of(sent[0]))
    event = AuditEvent.objects.get(noun="LostFile")
    assert event.details["file"] == name_of(sent[0])
    assert event.details["reason"] == "the disk is gone"


def test_the_command_and_the_pages_say_how_many_files_are_known_to_be_lost(
    sent: list[Submission], folder: Path, keeper: Client, capsys: pytest.CaptureFixture[str]
) -> None:
    for submission in sent:
        stored(submission).unlink()
    acknowledge(*map(name_of, sent))
    call_command("backup", str(folder))
    out = capsys.readouterr().out
    assert "2 files known to be lost for good" in out
    assert name_of(sent[0]) in out
    assert "without 2 files known to be lost" in keeper.get("/maintain/").text
    assert figures()["tsttc_backup_files_lost"] == 2
