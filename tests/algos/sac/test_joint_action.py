"""What losses see of a discrete part: probabilities that cannot saturate."""

import math

import pytest
import torch
from torch.distributions import Categorical

from veca_marl.algos.sac.joint_action import LEAST_PROBABILITY_RATIO, JointAction
from veca_marl.algos.specs import PLAIN, ActionLayout


def probabilities(logits):
    choice = JointAction("team", {PLAIN: ActionLayout(True, logits.shape[-1])})
    return choice.propose(Categorical(logits=logits)).probabilities


@pytest.mark.parametrize("choices", [2, 5])
def test_a_saturated_choice_is_left_when_another_one_has_the_greater_value(choices):
    """The values are exact; without a bound 4000 steps change the logits by less than 0.001."""
    logits = torch.full((1, choices), -30.0)
    logits[0, 0] = 0.0
    logits.requires_grad_(True)
    values = torch.nn.functional.one_hot(torch.tensor([choices - 1]), choices)
    optimizer = torch.optim.Adam([logits], 0.1)
    for _ in range(400):
        optimizer.zero_grad()
        (-(probabilities(logits) * values).sum()).backward()
        optimizer.step()
    assert float(logits.detach().softmax(-1)[0, -1]) > 0.9


@pytest.mark.parametrize("distance", [7.0, 30.0, 300.0])
def test_losses_lower_no_choice_that_is_below_the_bound(distance):
    assert distance > -math.log(LEAST_PROBABILITY_RATIO)
    logits = torch.tensor([[0.0, -distance, -distance]], requires_grad=True)
    (-(probabilities(logits) * torch.tensor([1.0, 0.0, -1.0])).sum()).backward()
    assert (logits.grad == 0.0).all()


def test_choices_within_the_bound_are_those_of_the_policy():
    torch.manual_seed(0)
    logits = torch.rand(64, 6) * 6.0
    bounded, exact = (logits.clone().requires_grad_(True) for _ in range(2))
    values = torch.randn(64, 6)
    (probabilities(bounded) * values).sum().backward()
    (exact.softmax(-1) * values).sum().backward()
    torch.testing.assert_close(probabilities(logits), logits.softmax(-1))
    torch.testing.assert_close(bounded.grad, exact.grad, atol=1e-5, rtol=1e-4)
