"""Processes of a chaos run: in groups of their own, killed, stopped and continued, never outliving it."""

import os
import shutil
import signal
import subprocess
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[2]
TIMEOUT_S = 120.0


class Process:
    """One process and whatever it starts. Its output goes to `{name}.log`.

    It must be started from a thread that lives as long as the run: the kernel ends it with that thread.
    """

    def __init__(
        self,
        name: str,
        command: Sequence[str],
        *,
        directory: Path,
        environment: Mapping[str, str],
        user: str | None = None,
    ) -> None:
        self.name = name
        self.log_path = directory / f"{name}.log"
        self._command = [*_guard(user), *command]
        self._environment = dict(environment)
        self._child: subprocess.Popen[bytes] | None = None

    @property
    def pid(self) -> int:
        if self._child is None:
            raise RuntimeError(f"{self.name} was never started")
        return self._child.pid

    @property
    def is_alive(self) -> bool:
        return self._child is not None and self._child.poll() is None

    def start(self) -> None:
        """Start it, in a session of its own."""
        with self.log_path.open("ab") as log:
            self._child = subprocess.Popen(
                self._command,
                cwd=REPOSITORY,
                env=self._environment,
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
                start_new_session=True,
            )

    def send(self, number: signal.Signals) -> None:
        """A signal to the process and everything that it has started in its group."""
        with suppress(ProcessLookupError):
            os.killpg(self.pid, number)

    def kill(self) -> None:
        """End all of it at once, as a power cut would."""
        self.send(signal.SIGKILL)
        self.wait()

    def kill_if_started(self) -> None:
        """For the end of a run: whatever state it is in."""
        if self._child is not None:
            self.kill()

    def ask_to_end(self, number: signal.Signals = signal.SIGTERM) -> None:
        """Ask the process itself; kill it if it does not obey. What it leaves behind is killed as well."""
        if self.is_alive:
            os.kill(self.pid, number)
            with suppress(subprocess.TimeoutExpired):
                self.wait()
        self.kill_if_started()

    def wait(self) -> None:
        if self._child is not None:
            self._child.wait(TIMEOUT_S)

    def children(self) -> list[int]:
        """Processes that it has started itself, in the order of their numbers."""
        return children_of(self.pid)

    def output(self) -> str:
        return self.log_path.read_text(errors="replace") if self.log_path.exists() else ""


def children_of(pid: int) -> list[int]:
    """Processes that this one has started itself, in the order of their numbers."""
    children: set[int] = set()
    with suppress(FileNotFoundError, ProcessLookupError):
        for task in Path(f"/proc/{pid}/task").iterdir():
            children |= {int(child) for child in (task / "children").read_text().split()}
    return sorted(children)


def _guard(user: str | None) -> list[str]:
    """A prefix to a command: the kernel ends it with this run; `user` gives up root's rights first."""
    setpriv = shutil.which("setpriv")
    if setpriv is None:
        raise FileNotFoundError("setpriv (util-linux) is not installed")
    identity = [f"--reuid={user}", f"--regid={user}", "--init-groups"] if user else []
    return [setpriv, *identity, "--pdeathsig=KILL", "--"]
