"""Proofs of steps, and Coal's of their motion, held against steps that attain their bounds."""

from itertools import product

import numpy as np
import pytest
from hanging_chain import LENGTHS, RADIUS, SLAB, tips
from numba import njit
from step_proofs import proofs

from kinarm.arm import Arm
from kinarm.bodies import Body
from kinarm.body_motion import BodyMotion
from kinarm.collision import Step
from kinarm.episodes import INTERVALS
from kinarm.kernels.planes import DEPTH
from kinarm.kernels.proof import MARGIN, SURE_FREEDOM, open_parts
from kinarm.problem import PROBLEMS
from kinarm.scene import Scene
from kinarm.simulator import Simulator
from kinarm.step_contact import first_share, steps_in_contact

AXES, TOP = ("0 0 1", "1 0 0"), 1.1
"""Slides, and the top of the slab below them [m]."""


@pytest.fixture(scope="module", params=[(), (SLAB,)], ids=["ground", "slab"])
def below(request, hanging):
    """A hanging chain, and the height of what is below it [m]."""
    return hanging(*request.param), SLAB.upper[2] * len(request.param)


@pytest.mark.parametrize("tested", [2, 4, 32])
def test_bounds_of_steps_hold_and_are_attained(below, tested):
    """Within a step between free configurations, the ball dips as deep as it can."""
    (simulator, level), rng = below, np.random.default_rng(1)
    moves = rng.uniform(0.05, 0.1, (200, 3)) * rng.choice([-1, 1], (200, 1))
    dip = np.square(np.cumsum(moves, axis=1)) @ LENGTHS / 8
    # The chain hangs down at this share of a step; if earlier than halfway, the ball ends higher.
    lowest = np.where(np.arange(200) % 2, 0.5, rng.uniform(0.3, 0.5, 200))
    way = np.zeros((tested + 1, 200, 4))
    way[..., 1:] = (np.arange(tested + 1)[:, None] / tested - lowest)[..., None] * moves
    # The lowest configuration touches by a fiftieth of the dip.
    way[..., 0] = level + RADIUS - 0.02 * dip - tips(way)[1:, :, 1].min(axis=0)
    heights = tips(way)[..., 1] - level - RADIUS
    bounds, doubt, touching = proofs(simulator, tested, way[0], way[-1])
    least = heights[1:].min(axis=0)
    assert (heights[0] > MARGIN).all()
    assert (bounds <= least + 1e-12).all()
    attained = (lowest == 0.5) | (tested == 2)
    assert (bounds > least - 0.01 * dip)[:, attained].all()
    doubted = heights[1:] <= MARGIN
    np.testing.assert_array_equal(doubt, (doubted << np.arange(tested)[:, None]).sum(axis=0))
    first = np.take_along_axis(heights[1:], doubted.argmax(axis=0)[None], axis=0)[0]
    np.testing.assert_array_equal(touching, first < -DEPTH)


def test_nothing_is_claimed_between_margin_and_depth(below):
    """They are 2 um and 1 um, as the docs say."""
    simulator, level = below
    gaps = np.outer([0.1, 0.95, 1.05], [-1e-6, 2e-6]).ravel()
    starts, ends = np.zeros((2, len(gaps), 4))
    ends[:, 0] = level + RADIUS + LENGTHS.sum() + gaps
    starts[:, 0] = ends[:, 0] + 0.1
    _, free, touching, _ = simulator.world.proven(ends)
    np.testing.assert_array_equal(free, gaps > 2e-6)
    np.testing.assert_array_equal(touching, gaps < -1e-6)
    _, doubt, touching = proofs(simulator, 1, starts, ends)
    np.testing.assert_array_equal(doubt, gaps <= 2e-6)
    np.testing.assert_array_equal(touching, gaps < -1e-6)


def dipping(level, moves, lowest, heights):
    """Ends of steps in which the ball comes down to heights, when the chain hangs straight [m].

    Bends are as large as they can be: all axes turn the same way, and all speeds are horizontal.
    """
    starts, ends = np.zeros((2, len(moves), 4))
    starts[:, 1:], ends[:, 1:] = -lowest[:, None] * moves, (1 - lowest)[:, None] * moves
    starts[:, 0] = ends[:, 0] = level + RADIUS + LENGTHS.sum() + heights
    return starts, ends


@pytest.mark.parametrize(("parts", "turn"), [(INTERVALS, 0.1), (INTERVALS**2, 1.0)])
def test_bounds_of_intervals_hold_and_are_attained(below, parts, turn):
    """The ball is lowest in the middle of an interval: just low enough for doubt, or just not."""
    (simulator, level), rng = below, np.random.default_rng(1)
    moves = turn * rng.uniform(0.8, 1.0, (200, 3)) * rng.choice([-1, 1], (200, 1))
    dip = np.square(np.cumsum(moves, axis=1)) @ LENGTHS / (8 * parts**2)
    lowest = (rng.integers(0, parts, 200) + 0.5) / parts
    free = np.arange(200) % 2 == 0
    starts, ends = dipping(level, moves, lowest, SURE_FREEDOM + np.where(free, 0.02, -0.02) * dip)
    _, doubt, _ = proofs(simulator, 0, starts, ends)
    there = 1 << (lowest * INTERVALS).astype(int)
    np.testing.assert_array_equal(doubt & there, np.where(free, 0, there))
    assert (doubt[free] == 0).all()


def test_steps_are_looked_at_from_their_beginning(below):
    """However fast the ball leaves, the first interval is in doubt if it begins too low."""
    (simulator, level), gaps = below, np.array([1.2e-6, 2.1e-6])
    starts, ends = dipping(level, np.zeros((2, 3)), np.zeros(2), gaps)
    ends[:, 0] += 0.1
    bounds, doubt, _ = proofs(simulator, 0, starts, ends)
    assert (bounds <= gaps + 1e-12).all()
    np.testing.assert_array_equal(doubt, [1, 0])


def test_parts_are_open_where_a_parabola_comes_to_the_margin():
    """Of heights that bend as much as they may everywhere, to just below the margin in a part."""
    found, rng = njit(lambda *given: open_parts(*given)), np.random.default_rng(2)
    shares = np.linspace(0, 1, 100 * INTERVALS + 1)
    parts = np.lib.stride_tricks.sliding_window_view(shares, 101)[::100]
    for tested in (0, 4):
        for bend in (0.0, *rng.uniform(1e-4, 0.1, 200)):
            rise = rng.uniform(-0.7, 0.7) * (bend or 1e-4)
            at = parts if tested == 0 else np.arange(1, tested + 1)[:, None] / tested
            least = (at * rise - 0.5 * at * (1 - at) * bend).min(axis=1)
            before = MARGIN - rng.choice(least) + rng.choice([-1, 1]) * 1e-5 * (bend or 1e-4)
            expected = np.flatnonzero(before + least <= MARGIN)
            assert found(before, before + rise, bend, tested) == (1 << expected).sum()


def test_contact_at_an_end_is_claimed_where_coal_finds_it(below):
    simulator, level = below
    gaps = np.array([0.9e-6, 0.98e-6, 1.02e-6, 1.08e-6])
    starts, ends = dipping(level, np.zeros((4, 3)), np.zeros(4), gaps)
    starts[:, 0] += 0.1
    _, _, touching = proofs(simulator, 0, starts, ends)
    np.testing.assert_array_equal(touching, gaps < 1e-6)
    model = simulator.world.contact_model
    coal = [first_share(Step(model, *each), 0, 1)[0] for each in zip(starts, ends, strict=True)]
    np.testing.assert_array_equal([each is not None for each in coal], gaps < 1e-6)


@pytest.fixture(scope="module", params=[0.0, 0.5], ids=["resting", "rising"])
def sliding(request, make_joint, make_collision, write_robot):
    """A ball on two slides, along z and x, above a slab that rests or rises [m/s]."""
    limit = '<limit lower="-1" upper="1" velocity="5" effort="0"/>'
    slides = [make_joint("prismatic", axis=axis, xyz="0 0 1", limit=limit) for axis in AXES]
    ball = make_collision(f'<sphere radius="{RADIUS}"/>')
    arm = Arm.load(write_robot(slides, {2: ball}, tool="0 0 0"))
    rising = request.param and BodyMotion(velocity=(0, 0, request.param))
    slab = Body(
        name="slab", shape="box", size=(6, 6, 0.2), position=(0, 0, 1), motion=rising or None
    )
    scene = Scene(ground=False, obstacles=(slab,), goal_regions=Scene().goal_regions)
    return Simulator(PROBLEMS["both"].replace(arm=arm, scene=scene), threads=1)


def slide(simulator, gap, down=0.0, along=0.0):
    """A step that ends in a gap above the slab [m], after a way down or along it."""
    model, rise = simulator.world.contact_model, simulator.problem.body_offsets(np.arange(2))
    end = np.array([[RADIUS + gap + TOP + rise[1].sum() - 2.0, along]])
    start = end + np.array([down, -along])
    placed = model.shapes.placed[None][: len(model.shapes.moving)]
    (step,) = simulator.world.steps_of(start, end, placed, np.zeros(1, dtype=int))
    return step


@pytest.mark.parametrize("down", [0.0, 0.07])
def test_contact_is_found_of_what_meets_as_fast_as_it_can(sliding, down):
    """Contact is what comes within 1 um, as the docs say; arm and slab move towards each other."""
    for gap, expected in ((0.95e-6, True), (1.05e-6, False)):
        share, _ = first_share(slide(sliding, gap, down), 0, 1)
        assert (share is not None) == expected


@pytest.mark.parametrize("sliding", [0.0], indirect=True)
def test_what_is_proven_free_can_be_told_from_contact(sliding):
    """Slides along the slab, whose halves of intervals end as long as they may, or a bit longer."""
    proven, judged = [], []
    for gap, reach in product((1.2e-6, 1.245e-6, 1.255e-6), (2.49e-7, 2.6e-7)):
        step = slide(sliding, gap, along=2**7 * reach)
        ends = (each[None] for each in (step.start, step.end))
        proven.append(proofs(sliding, 0, *ends)[1][0] == 0)
        judged.append(first_share(step, 0, 1)[0] is None)
    assert proven == [False, False, False, False, True, True]
    assert judged == [False, True, False, True, True, True]


def test_a_dip_between_free_configurations_is_in_doubt(hanging):
    """The chain dips as deep as its bend allows, to just above the margin or just below."""
    simulator, rng = hanging(), np.random.default_rng(1)
    moves = rng.uniform(0.05, 0.1, (400, 3)) * rng.choice([-1, 1], (400, 1))
    lowest = np.where(np.arange(400) % 2, 0.5, rng.uniform(0.3, 0.7, 400))
    shares = np.linspace(0, 1, 2001)
    way = np.zeros((2001, 400, 4))
    way[..., 1:] = (shares[:, None] - lowest)[..., None] * moves
    height = np.where(np.arange(400) % 3, 1e-4, 0.0) + MARGIN
    height = np.where(np.arange(400) % 5, height, MARGIN - 1e-6)
    way[..., 0] = RADIUS - tips(way)[..., 1].min(axis=0) + height
    assert (tips(way)[0, :, 1] - RADIUS > MARGIN).all()
    bounds, doubt, _ = proofs(simulator, 0, way[0], way[-1])
    assert (bounds <= height + 1e-9).all()
    assert (doubt[height < MARGIN] != 0).all()
    assert (doubt[height > 5e-5] == 0).all()
    part = np.floor(lowest * 16).astype(int)
    below = height < MARGIN
    assert (doubt[below] >> part[below] & 1).all()


def test_intervals_in_doubt_are_looked_at_to_their_ends(hanging):
    """The ball just touches the ground near an end of an interval."""
    simulator, parts = hanging(), np.array([1, 8, INTERVALS])
    for near in (0.05, 0.95):
        moves, lowest = np.ones((3, 3)), (parts - 1 + near) / INTERVALS
        ends = dipping(0.0, moves, lowest, np.full(3, 0.5e-6))
        steps = [Step(simulator.world.contact_model, *each) for each in zip(*ends, strict=True)]
        for open_part, expected in ((parts, True), (parts + (1 if near > 0.5 else -1), False)):
            kept = (open_part > 0) & (open_part <= INTERVALS)
            chosen = [step for step, is_kept in zip(steps, kept, strict=True) if is_kept]
            touched, _ = steps_in_contact(chosen, 1 << (open_part[kept] - 1), simulator.world.rules)
            assert (touched == expected).all()
