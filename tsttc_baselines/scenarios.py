"""The paper's six driving scripts as one kinematic model (Table 12, appendix G), solved event by event.

Ego follows a vehicle on a straight road. Accelerations are piecewise constant, so every event (a trigger,
standstill, contact, a finished lane change) is the root of a line or a parabola, and a frame at any time is
exact.

Not in the paper: whether a triple (a, b, s) includes b (`closed`); a lane is 3.75 m wide; a run ends at
contact (scripts 5 and 6: at 5 m), after a lane change, or at equal speeds if the gap would grow; a braking
vehicle stops; the two distances of script 3 are one.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields
from functools import cached_property
from itertools import product
from typing import Final

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

LANE_WIDTH_M: Final = 3.75
_KM_PER_H: Final = 1 / 3.6
_NEVER: Final = np.inf
_MAX_PHASES: Final = 8


@dataclass(frozen=True, slots=True)
class Run:
    """One run of a script, in SI units; a gap is from ego's camera to the vehicle's rear."""

    script: int
    ego_mps: float
    vehicle_mps: float
    gap_m: float
    ego_mps2: float = 0.0
    """Ego's acceleration until it brakes."""
    vehicle_mps2: float = 0.0
    """The vehicle's acceleration until it stands."""
    brake_after_s: float = _NEVER
    """Ego brakes from this time on …"""
    brake_gap_m: float = -_NEVER
    """… or from this gap on, until its speed is the vehicle's."""
    brake_mps2: float = 0.0
    lane_gap_m: float = -_NEVER
    """One of the two changes lane from this gap on."""
    lateral_mps: float = 0.0
    cuts_in: bool = False
    """The vehicle comes from the next lane; otherwise ego leaves for it."""
    end_gap_m: float = 0.0


def _values(start: float, stop: float, step: float, *, closed: bool) -> Floats:
    n = round((stop - start) / step) + closed
    values = np.asarray(start + step * np.arange(n), dtype=np.float64)
    return values[values <= stop + 1e-9]


def runs(*, closed: bool = True) -> list[Run]:
    """Return all runs of scripts 1–6 in order, with `closed` or half-open triples.

    >>> len(runs(closed=True)), len(runs(closed=False))
    (3218, 2089)
    """
    return [*_braking_runs(), *_leaving_runs(closed), *_cutting_in_runs(closed), *_closing_runs(closed)]


def _braking_runs() -> Iterator[Run]:
    """Scripts 1 and 4: the vehicle brakes at 3 m/s², after 3 s ego brakes at 4 m/s²."""
    speeds = [(1, v, v, 50.0) for v in (40, 60, 80)] + [(4, v, 60, 65.0) for v in (60, 80)]
    for script, ego, vehicle, gap_m in speeds:
        yield Run(
            script=script,
            ego_mps=ego * _KM_PER_H,
            vehicle_mps=vehicle * _KM_PER_H,
            gap_m=gap_m,
            vehicle_mps2=-3.0,
            brake_after_s=3.0,
            brake_mps2=4.0,
        )


def _leaving_runs(closed: bool) -> Iterator[Run]:
    """Script 2: ego is 20 km/h faster and leaves the lane at 2 m/s."""
    for ego, lane_gap_m in product((40, 60, 80), _values(10, 50, 5, closed=closed)):
        yield Run(
            script=2,
            ego_mps=ego * _KM_PER_H,
            vehicle_mps=(ego - 20) * _KM_PER_H,
            gap_m=65.0,
            lane_gap_m=float(lane_gap_m),
            lateral_mps=2.0,
        )


def _cutting_in_runs(closed: bool) -> Iterator[Run]:
    """Script 3: ego accelerates; at one gap the vehicle cuts in and ego brakes at 4 m/s²."""
    ranges = (_values(0.5, 3, 0.5, closed=closed), _values(10, 50, 5, closed=closed))
    for ego, vehicle, ego_mps2, gap_m in product((60, 80), (20, 40), *ranges):
        yield Run(
            script=3,
            ego_mps=ego * _KM_PER_H,
            vehicle_mps=vehicle * _KM_PER_H,
            gap_m=65.0,
            ego_mps2=float(ego_mps2),
            brake_gap_m=float(gap_m),
            brake_mps2=4.0,
            lane_gap_m=float(gap_m),
            lateral_mps=2.0,
            cuts_in=True,
        )


def _closing_runs(closed: bool) -> Iterator[Run]:
    """Scripts 5 and 6: the slower vehicle accelerates; ego leaves the lane (5) or brakes (6), until 5 m."""
    acceleration = _values(0.5, 3, 0.5, closed=closed)
    leaving = (_values(20, 60, 4, closed=closed), _values(0.5, 1.5, 0.2, closed=closed))
    for ego, vehicle, mps2, gap_m, lateral_mps in product((40, 60), (20, 30), acceleration, *leaving):
        yield Run(
            script=5,
            ego_mps=ego * _KM_PER_H,
            vehicle_mps=vehicle * _KM_PER_H,
            gap_m=65.0,
            vehicle_mps2=float(mps2),
            lane_gap_m=float(gap_m),
            lateral_mps=float(lateral_mps),
            end_gap_m=5.0,
        )
    braking = (_values(10, 50, 4, closed=closed), _values(1, 4, 0.5, closed=closed))
    for ego, mps2, gap_m, brake_mps2 in product((40, 60, 80), acceleration, *braking):
        yield Run(
            script=6,
            ego_mps=ego * _KM_PER_H,
            vehicle_mps=(ego - 30) * _KM_PER_H,
            gap_m=65.0,
            vehicle_mps2=float(mps2),
            brake_gap_m=float(gap_m),
            brake_mps2=float(brake_mps2),
            end_gap_m=5.0,
        )


@dataclass(frozen=True, slots=True)
class State:
    """Positions of ego and vehicle: arrays of one shape, NaN after a run's end."""

    gap_m: Floats
    lateral_m: Floats
    """Sideways from ego's axis to the vehicle's; 0 where one follows the other."""
    ego_mps: Floats
    vehicle_mps: Floats

    @property
    def ttc_s(self) -> Floats:
        """τ = −y / ẏ in seconds (paper Eq. 1); infinite for a constant gap."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(self.gap_m / (self.ego_mps - self.vehicle_mps))


@dataclass(frozen=True, slots=True)
class _Phase:
    """Every run's state at the start of its phase, (n,), and its accelerations."""

    start_s: Floats
    state: State
    ego_mps2: Floats
    vehicle_mps2: Floats
    lateral_mps: Floats

    def after(self, passed_s: Floats) -> State:
        """Return the state `passed_s` after the phase's start."""
        s = self.state
        relative_mps2 = self.vehicle_mps2 - self.ego_mps2
        return State(
            gap_m=s.gap_m + (s.vehicle_mps - s.ego_mps) * passed_s + relative_mps2 / 2 * passed_s**2,
            lateral_m=s.lateral_m + self.lateral_mps * passed_s,
            ego_mps=s.ego_mps + self.ego_mps2 * passed_s,
            vehicle_mps=s.vehicle_mps + self.vehicle_mps2 * passed_s,
        )


@dataclass(frozen=True)
class Motion:
    """Solved runs: their phases and end times in seconds, (n,)."""

    phases: tuple[_Phase, ...]
    end_s: Floats

    def at(self, times_s: Floats) -> State:
        """Return each run's state at times (k,) or (n, k), (n, k)."""
        times_s = np.broadcast_to(times_s, (self.end_s.size, np.shape(times_s)[-1]))
        number = (self._starts_s[:, None, :] <= times_s[:, :, None]).sum(axis=2) - 1
        columns = np.take_along_axis(self._table, number[None], axis=2)
        start_s, gap_m, lateral_m, ego_mps, vehicle_mps, ego_mps2, vehicle_mps2, lateral_mps = columns
        phase = _Phase(
            start_s=start_s,
            state=State(gap_m=gap_m, lateral_m=lateral_m, ego_mps=ego_mps, vehicle_mps=vehicle_mps),
            ego_mps2=ego_mps2,
            vehicle_mps2=vehicle_mps2,
            lateral_mps=lateral_mps,
        )
        return phase.after(np.where(times_s <= self.end_s[:, None] + 1e-12, times_s - start_s, np.nan))

    @property
    def last(self) -> State:
        return self.at(self.end_s[:, None])

    @cached_property
    def _starts_s(self) -> Floats:
        return np.stack([phase.start_s for phase in self.phases], axis=1)

    @cached_property
    def _table(self) -> Floats:
        return np.stack(
            [
                np.stack(
                    [
                        phase.start_s,
                        *(phase.state.gap_m, phase.state.lateral_m),
                        *(phase.state.ego_mps, phase.state.vehicle_mps),
                        *(phase.ego_mps2, phase.vehicle_mps2, phase.lateral_mps),
                    ]
                )
                for phase in self.phases
            ],
            axis=2,
        )


def solve(all_runs: list[Run]) -> Motion:
    """Solve all runs together, one event of every run per round."""
    c = {f.name: np.array([getattr(run, f.name) for run in all_runs]) for f in fields(Run)}
    n = len(all_runs)
    state = State(
        gap_m=c["gap_m"].astype(np.float64),
        lateral_m=np.where(c["cuts_in"], LANE_WIDTH_M, 0.0),
        ego_mps=c["ego_mps"],
        vehicle_mps=c["vehicle_mps"],
    )
    now_s, end_s = np.zeros(n), np.full(n, np.nan)
    brakes, changes, stands = np.zeros(n, bool), np.zeros(n, bool), np.zeros(n, bool)
    phases: list[_Phase] = []
    while np.isnan(end_s).any():
        if len(phases) == _MAX_PHASES:
            raise ArithmeticError(f"A run has more than {_MAX_PHASES} phases.")
        phase = _Phase(
            start_s=now_s,
            state=state,
            ego_mps2=np.where(brakes, -c["brake_mps2"], c["ego_mps2"]),
            vehicle_mps2=np.where(stands, 0.0, c["vehicle_mps2"]),
            lateral_mps=np.where(changes, np.where(c["cuts_in"], -1.0, 1.0) * c["lateral_mps"], 0.0),
        )
        phases.append(phase)
        with np.errstate(invalid="ignore"):  # ∞ − ∞ for runs that have ended
            to_trigger_s = np.maximum(c["brake_after_s"] - now_s, 0.0)
        to_trigger_s = np.minimum(to_trigger_s, _time_to_gap(phase, c["brake_gap_m"]))
        to_brake_s = np.where(brakes, _NEVER, to_trigger_s)
        to_change_s = np.where(changes, _NEVER, _time_to_gap(phase, c["lane_gap_m"]))
        to_stand_s = _time_to_standstill(phase)
        to_end_s = _time_to_end(phase, c["end_gap_m"], cuts_in=c["cuts_in"])
        step_s = np.minimum.reduce([to_brake_s, to_change_s, to_stand_s, to_end_s])
        ended = ~np.isnan(end_s)
        end_s = np.where(~ended & (to_end_s <= step_s), now_s + step_s, end_s)
        step_s = np.where(np.isnan(end_s), step_s, 0.0)
        brakes, changes = brakes | (to_brake_s <= step_s), changes | (to_change_s <= step_s)
        stands = stands | (to_stand_s <= step_s)
        state = phase.after(step_s)
        # A phase after the end begins never, so that no frame falls into it.
        now_s = np.where(np.isnan(end_s), now_s + step_s, _NEVER)
    return Motion(phases=tuple(phases), end_s=end_s)


def _time_to_gap(phase: _Phase, gap_m: Floats) -> Floats:
    """Compute seconds until `gap_m`: 0 if already reached, ∞ if never."""
    with np.errstate(invalid="ignore", divide="ignore"):
        excess_m = phase.state.gap_m - gap_m
        closing_mps = phase.state.ego_mps - phase.state.vehicle_mps
        half = (phase.vehicle_mps2 - phase.ego_mps2) / 2
        # The smaller positive root of excess − closing·t + half·t², in the form that does not cancel.
        root = np.sqrt(closing_mps**2 - 4 * half * excess_m)
        passed_s = 2 * excess_m / (closing_mps + root)
    reached = np.isfinite(passed_s) & (passed_s >= 0)
    return np.where(excess_m <= 0, 0.0, np.where(reached, passed_s, _NEVER))


def _time_to_standstill(phase: _Phase) -> Floats:
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(phase.vehicle_mps2 < 0, -phase.state.vehicle_mps / phase.vehicle_mps2, _NEVER)


def _time_to_end(phase: _Phase, end_gap_m: Floats, *, cuts_in: NDArray[np.bool_]) -> Floats:
    """Compute seconds until the last gap, a finished lane change, or equal speeds."""
    s = phase.state
    relative_mps, relative_mps2 = s.vehicle_mps - s.ego_mps, phase.vehicle_mps2 - phase.ego_mps2
    with np.errstate(divide="ignore", invalid="ignore"):
        equal_s = np.where((relative_mps < 0) & (relative_mps2 > 0), -relative_mps / relative_mps2, _NEVER)
        left_m = np.where(cuts_in, s.lateral_m, LANE_WIDTH_M - s.lateral_m)
        change_s = np.where(phase.lateral_mps != 0, left_m / np.abs(phase.lateral_mps), _NEVER)
    return np.minimum(np.minimum(equal_s, change_s), _time_to_gap(phase, end_gap_m))
