"""Slip events of synthetic saw-teeth: which are found, their drops, and the statistics of catalogues."""

import math

import numpy as np
import pytest
from scipy.signal import lfilter

from taichi_lsm import InputError
from taichi_lsm.statistics import b_value, catalogue_statistics, detect_events, magnitude_of_completeness

NOISE = 0.05  # of the stress; three of them are the smallest drop
FAST = 5  # rows of an event
STEP = 0.01  # [s] between rows; spring and load velocity are 1


def correlated(rng, count, size):
    """Noise with a correlation of half from row to row."""
    return size * math.sqrt(0.75) * lfilter([1.0], [1.0, -0.5], rng.normal(size=count + 50))[50:]


def saw_tooth(rng, count, noise=NOISE, velocity_noise=0.3):
    """(time, stress, platen velocity, onset, drop) of `count` events: loading at 1 Pa/s, drops of 3 to 60 noises."""
    drops = NOISE * np.exp(rng.uniform(math.log(3.05), math.log(60.0), count))
    rates, onsets = [np.full(200, 1.0)], []
    for drop in drops:
        onsets.append(STEP * (sum(map(len, rates))))
        loading = max(12, round((drop + (FAST * STEP)) / STEP))
        rates += [np.full(FAST, -drop / (FAST * STEP)), np.full(loading, 1.0)]
    rate = np.concatenate(rates)
    stress = np.cumsum(rate) * STEP + correlated(rng, rate.size, noise)
    velocity = 1.0 - rate + correlated(rng, rate.size, velocity_noise)
    return STEP * np.arange(1, rate.size + 1), stress, velocity, np.array(onsets), drops


def matched(events, onsets):
    """(share of the events found, number of those that are none)."""
    apart = np.abs(events.start.values[:, None] - onsets[None, :]) <= 3 * STEP
    return float(np.mean(apart.any(axis=0))), int(np.sum(~apart.any(axis=1)))


def check_detection(seed, count):
    time, stress, velocity, onsets, drops = saw_tooth(np.random.default_rng(seed), count)
    events = detect_events(time, stress, velocity, 1.0)
    found, false = matched(events, onsets)
    nearest = np.argmin(np.abs(events.start.values[:, None] - onsets[None, :]), axis=1)
    bias = float(np.mean(events.stress_drop.values - drops[nearest]) / drops.mean())
    pull = (events.stress_drop.values - drops[nearest]) / events.stress_drop_error.values
    print(f"\n{count} events: found {found:.4f}, false {false}, bias of the drop {bias:+.4f}, pull {pull.std():.2f}")
    assert found >= 0.99 and false == 0 and abs(bias) < 0.01
    assert pull.std() == pytest.approx(1.0, abs=0.15)  # the noise is correlated: 1.8 by the noise of single rows
    return events


def test_events_of_a_noisy_saw_tooth_are_found():
    events = check_detection(3, 200)
    assert events.stress_noise == pytest.approx(NOISE, rel=0.15)  # neighbours are correlated: lines follow them
    assert events.stress_drop.attrs["units"] == "Pa" and events.slip.attrs["units"] == "m"


@pytest.mark.validate
def test_events_of_long_noisy_saw_teeth_are_found():
    for seed in range(5):
        check_detection(seed, 2000)


def test_an_event_without_noise_is_measured_exactly():
    time, stress, velocity, onsets, drops = saw_tooth(np.random.default_rng(1), 20, 0.0, 0.0)
    events = detect_events(time, stress, velocity, 1.0)
    assert events.stress_drop.values == pytest.approx(drops)
    assert events.start.values == pytest.approx(onsets)
    assert events.duration.values == pytest.approx(FAST * STEP)
    assert events.slip.values == pytest.approx(drops + FAST * STEP)  # spring and load velocity are 1
    assert events.peak_velocity.values == pytest.approx(drops / (FAST * STEP) + 1.0)
    assert math.isnan(events.recurrence[0]) and events.recurrence.values[1:] == pytest.approx(np.diff(onsets))


def test_an_event_that_begins_and_ends_within_rows_reaches_from_row_to_row():
    """Its start is early and its end late, by half a row on average; the drop lacks what loading adds in a row."""
    rng, rows, per, parts, drop, lasts = np.random.default_rng(5), 6000, 60, 20, 6.0, 2.3
    load, fine = drop / per, np.arange(rows * parts) / parts
    onsets = per * np.arange(1, rows // per) + rng.uniform(0.0, 1.0, rows // per - 1)
    fast = (np.searchsorted(onsets, fine, "right") > 0) & (
        fine - onsets[np.maximum(np.searchsorted(onsets, fine, "right") - 1, 0)] < lasts
    )
    velocity = np.where(fast, load + drop / lasts, 0.0).reshape(rows, parts).mean(axis=1)
    stress = np.cumsum(load - velocity)
    events = detect_events(np.arange(1.0, rows + 1.0), stress, velocity + 1e-3 * load * rng.normal(size=rows), load)
    assert events.sizes["event"] == onsets.size
    assert float(np.mean(events.start.values - onsets)) == pytest.approx(-0.5, abs=0.1)
    assert float(np.mean(events.end.values - onsets - lasts)) == pytest.approx(0.5, abs=0.1)
    assert float(events.stress_drop.mean()) == pytest.approx(drop - load, abs=0.1 * load)
    assert events.slip.values == pytest.approx(drop + load * lasts, rel=0.01)  # nothing of it is lost


def test_hysteresis_keeps_an_event_whole():
    """A platen that slows down within an event, not below the lower threshold, makes one event of it."""
    rng = np.random.default_rng(2)
    velocity = correlated(rng, 400, 0.1)
    velocity[200:210] = [9, 9, 9, 0.4, 0.4, 0.4, 9, 9, 9, 9]  # four deviations in the middle
    stress = np.cumsum(0.01 * (0.5 - velocity))
    times = STEP * np.arange(400)
    assert detect_events(times, stress, velocity, 0.1).sizes["event"] == 1
    assert detect_events(times, stress, velocity, 0.1, end=12.0, onset=15.0).sizes["event"] == 2


def test_noise_alone_and_steady_sliding_have_no_events():
    rng = np.random.default_rng(4)
    quiet = detect_events(np.arange(20000.0), correlated(rng, 20000, NOISE), 1.0 + correlated(rng, 20000, 0.3), 1.0)
    assert quiet.sizes["event"] == 0 and set(quiet) >= {"start", "stress_drop", "slip"}
    with pytest.raises(InputError, match="events: 0, at least 2"):
        catalogue_statistics(quiet)


def test_series_that_do_not_fit_are_refused():
    good = np.arange(100.0)
    with pytest.raises(InputError, match="time: value 1 "):
        detect_events(good[::-1], good, good, 1.0)
    with pytest.raises(InputError, match="stress: 99 values"):
        detect_events(good, good[1:], good, 1.0)
    with pytest.raises(InputError, match="end: 7"):
        detect_events(good, good, good, 1.0, end=7.0)


def test_the_means_of_a_catalogue():
    time, stress, velocity, _, drops = saw_tooth(np.random.default_rng(1), 20, 0.0, 0.0)
    found = catalogue_statistics(detect_events(time, stress, velocity, 1.0))
    assert found.events == 20 and found.stress_drop.mean == pytest.approx(drops.mean())
    assert found.stress_drop.standard_error == pytest.approx(drops.std(ddof=1) / math.sqrt(20))
    assert found.recurrence.effective_samples == 19 and 0.5 < found.recurrence_variation < 1.5


def test_that_all_durations_are_of_as_many_rows_is_no_error_of_their_mean():
    time, stress, velocity, _, _ = saw_tooth(np.random.default_rng(1), 20, 0.0, 0.0)
    duration = catalogue_statistics(detect_events(time, stress, velocity, 1.0)).duration
    assert duration.mean == pytest.approx(FAST * STEP) and math.isnan(duration.standard_error)
    assert duration.unknown.startswith("all values are equal, as of times in whole rows")


def coverage_of_b(rng, count, trials, b=1.2):
    magnitudes = 2.0 + rng.exponential(1.0 / (b * math.log(10.0)), (trials, count))
    found = [b_value(m, 2.0).b for m in magnitudes]
    return np.mean([abs(e.mean - b) <= e.half_width for e in found]), np.mean([e.mean for e in found]) / b


@pytest.mark.parametrize("count", [60, 300])
def test_b_values_are_covered(count):
    covered, ratio = coverage_of_b(np.random.default_rng(count), count, 3000)
    print(f"\n{count} events: b covered {covered:.3f}, mean over truth {ratio:.4f}")
    assert covered == pytest.approx(0.95, abs=0.03) and ratio == pytest.approx(1.0, abs=0.01)


def test_binned_magnitudes_have_the_same_b_value():
    m = 2.0 + np.random.default_rng(1).exponential(1.0 / math.log(10.0), 200_000)
    binned = np.round(m, 1)
    assert b_value(binned[binned >= 2.2], 2.2, 0.1).b.mean == pytest.approx(1.0, abs=0.01)
    assert b_value(binned[binned >= 2.2], 2.2).b.mean > 1.08  # without the correction


def test_completeness_of_a_catalogue_that_fades():
    """Events are seen with a probability that rises from 0 to 1 about a magnitude of 2."""
    rng = np.random.default_rng(2)
    m = rng.exponential(1.0 / math.log(10.0), 400_000)
    seen = m[rng.random(m.size) < 1.0 / (1.0 + np.exp(-(m - 2.0) / 0.06))]
    assert 2.0 < magnitude_of_completeness(seen) < 2.6
    assert abs(b_value(seen).b.mean - 1.0) < 3 * b_value(seen).b.standard_error < 0.2
    assert "at least 50 are needed" in b_value(seen[:60]).b.unknown
    with pytest.raises(InputError, match="lie above it"):
        b_value(seen, 99.0)
