"""The loss of imitation against the distributions themselves."""

import math
from types import SimpleNamespace

import pytest
import torch
from fake_env import FakeEnv
from training import SMALL

from veca_marl.algos.imitation.loss import LARGEST_ACTION, ImitationLoss
from veca_marl.algos.networks.factory import make_network
from veca_marl.algos.specs import team_specs

SMALLEST = 1e-6


def policy_and_rows(rows=6, **env):
    torch.manual_seed(0)
    made = FakeEnv(rows, agents=2, **env)
    actor = make_network("agents", team_specs(made)["agents"], SMALL).actor
    state = made.rand_action(made.reset())
    return team_specs(made)["agents"].actions, actor.get_dist(state), state


def number(tensor):
    return float(tensor.detach())


def everything(rows=6):
    return torch.ones(rows, 2, dtype=torch.bool)


def test_of_a_vector_it_is_the_likelihood_before_tanh():
    actions, policy, rows = policy_and_rows()
    shown = rows["agents", "action"].clamp(-0.9, 0.9)
    rows["agents", "action"] = shown
    found = ImitationLoss("agents", actions, SMALLEST)(policy, rows, everything())
    jacobian = (1.0 - shown**2).log().sum(-1)
    wanted = -(policy.log_prob(shown) + jacobian).mean() / 2  # dimensions
    assert number(found.loss) == pytest.approx(number(wanted), abs=1e-4)
    error = (policy.loc.tanh() - shown).abs().mean()
    assert number(found.error) == pytest.approx(number(error), abs=1e-5)
    assert found.agreement.isnan()


def test_of_a_choice_it_is_the_cross_entropy():
    actions, policy, rows = policy_and_rows(discrete=True)
    found = ImitationLoss("agents", actions, SMALLEST)(policy, rows, everything())
    wanted = -policy.log_prob(rows["agents", "action"]).mean()
    assert number(found.loss) == pytest.approx(number(wanted), abs=1e-5)
    assert found.error.isnan()


def test_parts_are_weighted_by_their_dimensions():
    actions, policy, rows = policy_and_rows(hybrid=True)
    both = ImitationLoss("agents", actions, SMALLEST)(policy, rows, everything())
    each = [
        ImitationLoss("agents", {part: layout}, SMALLEST)(policy, rows, everything())
        for part, layout in actions.items()
    ]
    mean = (2 * number(each[0].loss) + number(each[1].loss)) / 3
    assert number(both.loss) == pytest.approx(mean, abs=1e-4)


@pytest.mark.parametrize("error", [0.0, 0.05, 1.0])
def test_the_best_scale_is_that_of_the_errors_and_the_least_one_together(error):
    actions, _, rows = policy_and_rows()
    shown = rows["agents", "action"].clamp(-0.9, 0.9)
    rows["agents", "action"] = shown
    best = math.hypot(error, 0.2)
    for ratio, sign in ((0.1, -1), (0.9, -1), (1.0, 0), (1.1, 1), (10.0, 1)):
        scale = torch.full_like(shown, ratio * best, requires_grad=True)
        loc = shown.atanh() + error
        policy = SimpleNamespace(loc=loc, scale=scale, deterministic_sample=loc.tanh())
        ImitationLoss("agents", actions, 0.2)(policy, rows, everything()).loss.backward()
        assert (scale.grad.abs() < 1e-5).all() if sign == 0 else (sign * scale.grad > 1e-5).all()


def test_actions_at_the_ends_of_the_range_have_a_finite_loss():
    actions, policy, rows = policy_and_rows()
    loss = ImitationLoss("agents", actions, 0.2)
    rows["agents", "action"] = torch.ones(6, 2, 2)
    at_the_end = loss(policy, rows, everything()).loss
    rows["agents", "action"] = torch.full((6, 2, 2), LARGEST_ACTION)
    assert at_the_end == loss(policy, rows, everything()).loss


def test_entries_that_do_not_count_change_nothing():
    actions, policy, rows = policy_and_rows()
    loss, counted = ImitationLoss("agents", actions, 0.2), everything()
    counted[:, 1] = False
    before = loss(policy, rows, counted).loss
    rows["agents", "action"][:, 1] = torch.nan
    assert loss(policy, rows, counted).loss == before
    assert loss(policy, rows, torch.zeros_like(counted)).loss == 0.0
