"""Random streams by name."""

from itertools import product

import pytest

from kinarm.evaluation.trials import trial_generator
from kinarm.policies.ars.algorithm import ARSTraining
from kinarm.policies.recipes import recipe
from kinarm.streams import Stream, stream_generator


def test_a_stream_is_what_it_was():
    """Its numbers are part of what a seed means."""
    first = [stream_generator(stream, 7, 3).integers(1 << 32) for stream in Stream]
    assert first == [482907703, 3422100537, 4029689759, 2107721511, 1560255718, 3954885235]


@pytest.mark.parametrize("draw", ["random", "standard_normal"])
def test_no_two_purposes_share_numbers(draw):
    seeds, numbers = range(4), range(20)
    generators = [
        *(stream_generator(*each) for each in product(Stream, seeds, numbers)),
        *(stream_generator(*each) for each in product(Stream, seeds)),
        *(trial_generator(*each) for each in product(seeds, numbers, (0, 1))),
    ]
    first = {getattr(generator, draw)() for generator in generators}
    assert len(first) == len(generators)


def test_an_iteration_of_ppo_shares_nothing_with_the_trial_of_its_number():
    pytest.importorskip("torch")
    from kinarm.policies.ppo.learner import seed_iteration

    for iteration in range(5):
        ours = {generator.random() for generator in seed_iteration(0, iteration)}
        assert not ours & {trial_generator(0, iteration, stream).random() for stream in (0, 1)}


def test_a_training_of_ars_begins_with_its_stream():
    config = recipe("ars", "paper", problem="right", seed=5)
    begun = stream_generator(Stream.ARS, 5).bit_generator.state
    assert ARSTraining(config, threads=1).initial_state().generator == begun
