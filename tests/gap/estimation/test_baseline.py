"""Scatter between recordings: the linear mixed model against simulations of it, and a real baseline."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from drift_drake.car.effects.catalogue import CATALOGUE
from drift_drake.gap.estimation import baseline
from drift_drake.gap.estimation.baseline import (
    Known,
    Scatter,
    Spread,
    Stretches,
    known_from,
    known_without,
    predicted,
    scatter_of,
    slipping_of,
    spread_of,
    stretches_of,
)
from drift_drake.gap.estimation.prediction_constants import (
    FACTORS,
    FROM_LEFT_OUT,
    MODEL_FORM,
    SCALE,
    SCALE_WORTH,
    SLIGHT,
)
from drift_drake.gap.estimation.recordings_left_out import LeftOut, learnt_from, left_out, scale_of
from drift_drake.gap.estimation.scores import block_scores, make_day, summed
from drift_drake.gap.estimation.windows import windowed

SIZE, BLOCKS = 4, 6


def world(rng, count, deviation, form=0.1):
    """Stretches, each a recording, drawn from the model itself: deviation [SIZE], form: of each stretch's own."""
    roots = rng.normal(size=(count, SIZE, SIZE))
    information = BLOCKS * np.einsum("kij,klj->kil", roots, roots)
    scores = []
    for one in information:
        own = deviation + form * rng.normal(size=SIZE)
        noise = np.linalg.cholesky(one) @ rng.normal(size=SIZE)
        scores.append(-one @ own + noise)
    return Stretches(np.array(scores), information, np.full(count, float(BLOCKS)), np.ones(count), np.arange(count))


def spread(form=0.1, recording=0.0):
    """That noise is as the information tells, without more."""
    return Spread(np.eye(SIZE), np.ones(SIZE), 1.0, 0, np.full(SIZE, form**2), np.full(SIZE, recording**2))


@pytest.fixture
def plain(monkeypatch):
    """Blocks are independent, and scores scatter by what the information tells alone."""
    monkeypatch.setattr(baseline, "HANGS", 0.0)
    monkeypatch.setattr(baseline, "OFF_SHAPE", 0.0)


@pytest.fixture(scope="module")
def day(other_car):
    n, car = other_car.normal, other_car.found
    runs = [windowed(run) for run in other_car.runs]
    return make_day(runs, car.vehicle.constants(), car.effects, n.names, n.units, n)


@pytest.mark.usefixtures("plain")
def test_what_is_known_of_a_car_is_the_posterior_of_a_linear_regression():
    rng = np.random.default_rng(0)
    some = world(rng, 5, np.array([0.3, -0.2, 0.1, 0.0]))
    prior = np.full(SIZE, 0.5)
    known = known_from(some, spread(), prior)
    # By the whole covariance of all scores at once, without any of the sums over recordings.
    design = -np.concatenate(list(some.information))
    noise = np.zeros((5 * SIZE, 5 * SIZE))
    for k, one in enumerate(some.information):
        noise[k * SIZE : (k + 1) * SIZE, k * SIZE : (k + 1) * SIZE] = one + 0.01 * one @ one
    total = design @ np.diag(prior**2) @ design.T + noise
    gain = np.diag(prior**2) @ design.T @ np.linalg.inv(total)
    np.testing.assert_allclose(known.mean, gain @ some.scores.ravel(), rtol=1e-4, atol=1e-6)
    np.testing.assert_allclose(known.covariance, np.diag(prior**2) - gain @ design @ np.diag(prior**2), atol=1e-6)


def test_what_is_known_without_stretches_is_what_the_others_say():
    rng = np.random.default_rng(3)
    some = world(rng, 6, np.array([0.3, -0.2, 0.1, 0.0]))._replace(
        recording=np.array([0, 1, 0, 1, 1, 2]), blocks=rng.uniform(2.0, 9.0, 6), harder=rng.uniform(0.5, 2.0, 6)
    )
    masks = [np.arange(6) == 2, some.recording == 1, np.arange(6) > 3]
    model, prior = spread(recording=0.2)._replace(blocks=9, ratio=1.3), np.full(SIZE, 0.5)
    for mask, found in zip(masks, known_without(some, model, prior, masks), strict=True):
        expected = known_from(some.kept(~mask), model, prior)
        np.testing.assert_allclose(found.mean, expected.mean, rtol=1e-9)
        np.testing.assert_allclose(found.covariance, expected.covariance, rtol=1e-9)
    one, blocks = spread().of_blocks(some.information[4], some.blocks[4]), spread().of_blocks(*some[1:3])
    np.testing.assert_allclose(one, blocks[4])


@pytest.mark.usefixtures("plain")
def test_a_new_day_without_a_change_lies_as_far_off_as_is_said():
    rng, distances = np.random.default_rng(1), []
    for _ in range(300):
        deviation = 0.5 * rng.normal(size=SIZE)
        known = known_from(world(rng, 4, deviation), spread(), np.full(SIZE, 0.5))
        other = world(rng, 3, deviation)
        scatter = predicted(other, known, [spread()])
        x = other.scores.sum(axis=0) - scatter.mean
        distances.append(x @ scatter.inverse @ x)
    assert np.mean(distances) == pytest.approx(SIZE, rel=0.1)
    assert np.var(distances) == pytest.approx(2 * SIZE, rel=0.35)


@pytest.mark.usefixtures("plain")
def test_what_a_baseline_did_not_show_cancels_where_both_days_drive_alike():
    """A deviation that the baseline hardly shows widens a day that shows it well, and no day that hardly does."""
    blind = np.diag([10.0, 1e-3, 10.0, 10.0])
    some = Stretches(np.zeros((1, SIZE)), blind[None], np.array([float(BLOCKS)]), np.ones(1), np.zeros(1, dtype=int))
    known = known_from(some, spread(0.0), np.full(SIZE, 1.0))
    alike = predicted(some, known, [spread(0.0)]).covariance[1, 1]
    sees = some._replace(information=np.diag([10.0, 10.0, 10.0, 10.0])[None])
    assert alike == pytest.approx(1e-3, rel=0.01)  # its own noise: nothing of what is unknown
    assert predicted(sees, known, [spread(0.0)]).covariance[1, 1] == pytest.approx(10.0 + 10.0**2, rel=0.01)


def test_blocks_of_a_stretch_hang_together_and_recordings_share_what_varies():
    one, some = spread(0.0), spread(0.0, recording=0.3)
    information = BLOCKS * np.eye(SIZE)
    assert one.of_blocks(2 * information, 2 * BLOCKS)[0, 0] > 2.5 * one.of_blocks(information, BLOCKS)[0, 0]
    both = Stretches(
        np.zeros((2, SIZE)), np.stack([information] * 2), np.full(2, float(BLOCKS)), np.ones(2), np.array([0, 0])
    )
    apart = both._replace(recording=np.array([0, 1]))
    known = Known(np.zeros(SIZE), np.zeros((SIZE, SIZE)))
    extra = [predicted(part, known, [some]).covariance[0, 0] - predicted(part, known, [one]).covariance[0, 0]
             for part in (both, apart)]  # fmt: skip
    assert extra[0] == pytest.approx(0.09 * (2 * BLOCKS) ** 2)
    assert extra[1] == pytest.approx(2 * 0.09 * BLOCKS**2)


@pytest.mark.usefixtures("plain")
def test_a_recording_left_out_lies_where_the_others_say_and_one_of_another_car_does_not():
    rng = np.random.default_rng(2)
    some, prior = world(rng, 12, np.zeros(SIZE)), np.full(SIZE, 0.5)
    distances = [part.distance for part in left_out(some, spread(), prior)]
    assert len(distances) == 12
    assert 0.5 < np.mean(distances) < 1.6
    scores = some.scores.copy()
    scores[5] = scores[5] - some.information[5] @ np.full(SIZE, 3.0)
    odd = [part.distance for part in left_out(some._replace(scores=scores), spread(), prior)]
    assert int(np.argmax(odd)) == 5
    assert odd[5] > 10.0


@pytest.mark.usefixtures("plain")
@pytest.mark.parametrize("factor", FACTORS)
def test_a_baseline_tells_how_much_its_equations_lack_and_other_driving_may_ask_for_more(factor):
    own = 0.1
    drawn = world(np.random.default_rng(5), 40, np.zeros(SIZE), form=factor * own)
    shown = learnt_from(drawn, spread(own), np.full(SIZE, 0.5))
    assert np.logaddexp.reduce(shown.factors) == pytest.approx(0.0)
    assert FACTORS[int(np.argmax(shown.factors))] == factor
    # Nothing says that a car that shows little of it lacks no more elsewhere.
    beyond = np.array(FACTORS) >= factor
    prior = -0.5 * np.log(FACTORS) ** 2
    np.testing.assert_allclose(np.diff((shown.factors - prior)[beyond]), 0.0, atol=1e-9)


def test_a_day_scatters_by_each_factor_and_is_judged_at_the_most_probable():
    some = world(np.random.default_rng(6), 1, np.zeros(SIZE))
    known, models = Known(np.zeros(SIZE), np.zeros((SIZE, SIZE))), [spread().times(factor) for factor in (1.0, 4.0)]
    scatter = predicted(some, known, models, main=1)
    lacking = [c - spread(0.0).of_stretches(some) for c in scatter.covariances]
    np.testing.assert_allclose(lacking[1], 16.0 * lacking[0], rtol=1e-9)
    np.testing.assert_allclose(scatter.inverse @ scatter.covariances[1], np.eye(SIZE), atol=1e-9)
    x = np.random.default_rng(7).normal(size=(3, SIZE))
    ratios = [multivariate_normal(np.zeros(SIZE), c).logpdf(x) for c in scatter.covariances]
    found = scatter.log_densities(x)
    np.testing.assert_allclose(found[0] - found[1], ratios[0] - ratios[1], rtol=1e-9)


def test_stretches_of_a_single_recording_are_left_out_and_one_alone_cannot_be():
    some = world(np.random.default_rng(3), 3, np.zeros(SIZE))
    one = some._replace(recording=np.zeros(3, dtype=int))
    assert len(left_out(one, spread(), np.full(SIZE, 0.5))) == 3
    assert left_out(one.kept(np.array([True, False, False])), spread(), np.full(SIZE, 0.5)) == []


def test_the_scale_is_a_cars_own_as_far_as_its_recordings_tell():
    assert scale_of(np.zeros(0)) == SCALE
    few, many = scale_of(np.full(2, 5.0)), scale_of(np.full(200, 5.0))
    assert SCALE < few < many < FROM_LEFT_OUT * 5.0
    assert np.log(few) == pytest.approx(
        (SCALE_WORTH * np.log(SCALE) + 2 * np.log(FROM_LEFT_OUT * 5.0)) / (SCALE_WORTH + 2)
    )


def test_one_odd_recording_does_not_set_the_scale():
    odd, none = scale_of(np.array([0.4, 0.4, 0.4, 0.4, 80.0])), scale_of(np.full(5, 0.4))
    assert none < odd < 1.5 * none
    assert odd == scale_of(np.array([0.4, 0.4, 0.4, 0.4, 8000.0]))


def test_the_day_of_calibration_is_as_expected(other_car, day):
    normal = other_car.normal
    whole = dataclasses.replace(day, weights=np.ones(len(day.weights)))
    scatter = scatter_of(whole, normal)
    x = summed(whole, normal, whole.errors) - scatter.mean
    assert x @ scatter.inverse @ x < len(x)
    scores = block_scores(whole, whole.errors, normal.scales, normal.precision)
    np.testing.assert_allclose(stretches_of(whole, normal.scales, normal.precision, normal.slipping).scores.sum(axis=0),
                               scores.sum(axis=0), rtol=1e-9)  # fmt: skip
    np.testing.assert_allclose(np.trace(scatter.information), np.sum(normal.information) * normal.blocks, rtol=1e-6)


def test_a_longer_day_scatters_more(other_car, day):
    normal = other_car.normal
    sizes = []
    for part in (day.run < 1, day.run < 3):
        some = dataclasses.replace(
            day, runs=day.runs[: 1 if sizes == [] else 3], errors=day.errors[part], jacobian=day.jacobian[part],
            block=day.block[part], run=day.run[part], weights=day.weights[part],
        )  # fmt: skip
        sizes.append(np.diag(scatter_of(some, normal).covariance))
    seen = normal.information > 0.0
    assert np.all(sizes[1][seen] > sizes[0][seen])


def test_a_share_that_scores_scatter_by_alone_is_added_to_their_variances():
    scatter = Scatter(np.zeros(2), np.array([[[1.0, 0.9], [0.9, 1.0]]]), np.eye(2))
    np.testing.assert_allclose(scatter.apart(0.5).covariance, [[1.5, 0.9], [0.9, 1.5]])
    np.testing.assert_allclose(np.linalg.inv(scatter.apart(0.5).inverse), [[1.5, 0.9], [0.9, 1.5]])
    assert scatter.apart(0.0) is scatter


def test_tyres_and_body_are_worth_otherwise_on_other_drives_and_sensors_are_not():
    names = tuple(CATALOGUE)
    variances = dict(zip(names, baseline.variances_of_stretches(names, len(names) + 3)[: len(names)], strict=True))
    assert {name for name, q in variances.items() if q > 0.0} == {n for n, e in CATALOGUE.items() if e.of_tyres_or_body}
    assert variances["steering_delay"] == variances["gyro_bias"] == 0.0


def test_a_yaw_inertia_is_never_known_better_than_the_equations_hold(other_car):
    normal = other_car.normal
    for name, least in MODEL_FORM.items():
        i = normal.names.index(name)
        assert np.sqrt(normal.unknown[i, i]) * normal.units[i] > least


def test_what_varies_from_recording_to_recording_is_no_gap_of_a_calibrated_car(other_car):
    normal = other_car.normal
    i = normal.names.index("sideslip_bias")
    least_deviations = 0.5 * CATALOGUE["sideslip_bias"].least_for(other_car.guess) / normal.units[i]
    assert normal.least_deviations[i] == pytest.approx(least_deviations)
    assert normal.recording[i, i] >= least_deviations**2
    assert np.all(np.diag(normal.unknown) >= np.diag(normal.recording) / len(other_car.runs) - 1e-12)


def test_every_recording_of_a_baseline_is_left_out_once_and_asked(other_car):
    normal = other_car.normal
    assert normal.left_out.shape == normal.left_out_none.shape == (len(other_car.runs),)
    assert np.all((normal.left_out_none >= 0.0) & (normal.left_out_none <= 1.0))
    assert normal.scale == scale_of(normal.left_out)


def test_a_distance_is_per_score():
    information = BLOCKS * np.eye(SIZE)
    one = Stretches(
        np.full((1, SIZE), 3.0), information[None], np.full(1, float(BLOCKS)), np.ones(1), np.zeros(1, dtype=int)
    )
    known = Known(np.zeros(SIZE), np.zeros((SIZE, SIZE)))
    covariance = predicted(one, known, [spread(0.0)]).covariance
    assert LeftOut(one, known, spread(0.0)).distance == pytest.approx(
        9.0 * np.sum(np.linalg.inv(covariance)) / SIZE
    )  # fmt: skip


def test_what_is_known_of_other_cars_keeps_its_size_at_any_scale():
    information = BLOCKS * np.eye(SIZE)
    one = Stretches(
        np.zeros((1, SIZE)), information[None], np.full(1, float(BLOCKS)), np.ones(1), np.zeros(1, dtype=int)
    )
    known = Known(np.zeros(SIZE), np.zeros((SIZE, SIZE)))
    none, some = spread(0.0), spread(0.2, recording=0.3)
    more = [predicted(one, known, [some], scale).covariance - predicted(one, known, [none], scale).covariance
            for scale in (0.2, 1.0)]  # fmt: skip
    np.testing.assert_allclose(more[0], more[1], atol=1e-9)
    assert more[0][0, 0] == pytest.approx((0.2**2 + 0.3**2) * BLOCKS**2)
    blocks = [predicted(one, known, [none], scale).covariance[0, 0] for scale in (0.2, 1.0)]
    assert blocks[0] == pytest.approx(0.2 * blocks[1])


def test_blocks_scatter_more_where_tyres_slip_more_and_a_baseline_as_it_does_on_the_whole(other_car, day):
    normal = other_car.normal
    some = stretches_of(day, normal.scales, normal.precision, normal.slipping)
    windows = np.bincount(day.stretch)
    assert np.sum(windows * np.log(some.harder)) / windows.sum() == pytest.approx(0.0, abs=1e-6)
    harder = some._replace(harder=4.0 * some.harder)
    known, model = (
        Known(np.zeros(len(normal.expected)), np.zeros_like(normal.left_open)),
        spread_of(normal, normal.names, normal.least_deviations),
    )
    model = model._replace(stretch=0.0 * model.stretch, recording=0.0 * model.recording)
    one, other = (predicted(part, known, [model]).covariance for part in (some, harder))
    np.testing.assert_allclose(other, 4.0 * one, rtol=1e-9)


def test_slip_along_the_wheels_is_read_off_the_rim(other_car):
    run = windowed(other_car.runs[0])
    spinning = dataclasses.replace(run, start_y=run.start_y * np.array([1.0, 1.0, 1.0, 1.5, 1.0]))
    before, after = (float(np.mean(slipping_of(SimpleNamespace(runs=[part])))) for part in (run, spinning))
    assert after - before > 1.0
    assert after == pytest.approx(np.log(0.5 + SLIGHT), abs=0.1)


def test_a_day_of_some_windows_is_that_of_their_runs(other_car, day):
    normal, which = other_car.normal, (day.run != 1) & (day.block % 3 != 0)
    some = day.kept(which)
    again = make_day(some.runs, day.constants, day.own, normal.names, normal.units, normal)
    assert len(some.runs) == len(day.runs) - 1
    for name in ("errors", "jacobian", "block", "run", "weights"):
        np.testing.assert_array_equal(getattr(some, name), getattr(again, name))
