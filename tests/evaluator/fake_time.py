"""Time that passes only when a caller sleeps."""


class FakeTime:
    """A clock that only sleeping moves forward."""

    def __init__(self) -> None:
        self.now_s = 0.0
        self.slept_s: list[float] = []

    def sleep(self, seconds: float) -> None:
        self.slept_s.append(seconds)
        self.now_s += seconds
