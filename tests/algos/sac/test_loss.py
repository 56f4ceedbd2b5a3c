"""The losses equal TorchRL's where those exist, and integrals of the soft value elsewhere."""

from copy import deepcopy
from dataclasses import replace

import pytest
import torch
from tensordict import TensorDict
from tensordict.nn import TensorDictModule
from torch import nn
from torch.distributions import Normal
from torchrl.objectives import CrossQLoss, DiscreteSACLoss, SACLoss, SoftUpdate, ValueEstimators

from veca_marl.algos.networks.action_values import (
    ActionValuesCfg,
    ActorCritics,
    BatchRenorm,
    Normalisation,
    statistics_of,
)
from veca_marl.algos.networks.factory import NetworkCfg, NetworkFactory
from veca_marl.algos.networks.layers import PerAgent
from veca_marl.algos.sac.config import Adaptation, EncoderGradient, TemperatureCfg
from veca_marl.algos.sac.joint_action import JointAction
from veca_marl.algos.sac.loss import TeamCrossQLoss, TeamSACLoss, Temperatures
from veca_marl.algos.sac.replay import Transitions
from veca_marl.algos.specs import ActionLayout, ArrayLayout, TeamSpec

WIDTH, GAMMA, ALPHA = 4, 0.9, 0.3
CONTINUOUS = {"action": ActionLayout(discrete=False, size=2)}
DISCRETE = {"action": ActionLayout(discrete=True, size=3)}
HYBRID = {"move": ActionLayout(discrete=False, size=1), "voice": ActionLayout(True, 3)}
CRITIC = ActionValuesCfg(hidden=[16])
RENORMALISED = ActionValuesCfg(hidden=[16], normalisation=Normalisation.batch_renorm)
LEARNT = TemperatureCfg(ALPHA, Adaptation.automatic)


class Scale(nn.Module):
    """An encoder with one parameter, which is 1."""

    def __init__(self):
        super().__init__()
        self.scale = nn.Parameter(torch.ones(()))

    def forward(self, state):
        return state * self.scale


class PlainNetwork(NetworkFactory):
    """Features are the observation itself."""

    features = WIDTH

    def encoder(self):
        return TensorDictModule(
            Scale(),
            in_keys=[(self.team, "observation", "state")],
            out_keys=[(self.team, "features")],
        )


class Central(PlainNetwork):
    central_critic = True


def loss_of(
    actions,
    gradient=EncoderGradient.both,
    factory=PlainNetwork,
    agents=2,
    kind=TeamSACLoss,
    critic=CRITIC,
):
    """Return the loss of a network with random parameters, and its network."""
    torch.manual_seed(3)
    spec = TeamSpec(
        agents, {"state": ArrayLayout((WIDTH,), "float32", -1.0, 1.0)}, actions, masked=True
    )
    network = ActorCritics(factory("agents", spec, NetworkCfg()), critic, [8])
    with torch.no_grad():
        for name, parameter in network.named_parameters():
            if "scale" not in name:
                parameter.copy_(torch.randn_like(parameter) * 0.5)
    loss = kind(
        "agents",
        network,
        JointAction("agents", actions),
        Temperatures(actions, LEARNT),
        gradient,
    )
    if loss.averages:
        with torch.no_grad():
            for parameter in loss.target.parameters():
                parameter.mul_(0.8)
    return loss, network


def transitions_of(actions, rows=6, agents=2):
    generator = torch.Generator().manual_seed(5)

    def random(*shape):
        return torch.rand(rows, agents, *shape, generator=generator) * 2.0 - 1.0

    taken = {
        part: (random() > 0.0).long() if layout.discrete else random(layout.size)
        for part, layout in actions.items()
    }
    first, last = ({"observation": {"state": random(WIDTH)}} for _ in range(2))
    first["action"] = taken.get("action", taken)
    mask = torch.ones(rows, agents, dtype=torch.bool)
    return Transitions(
        TensorDict({"agents": first | {"mask": mask}}, (rows,)),
        TensorDict({"agents": last | {"mask": mask}}, (rows,)),
        returns=random(),
        discount=GAMMA * (random() > -0.5),
        counted=mask,
    )


class Value(nn.Module):
    """One critic as TorchRL's losses take it."""

    def __init__(self, layers):
        super().__init__()
        self.layers = layers

    def forward(self, *inputs):
        return self.layers(torch.cat(inputs, -1))


def torchrl_loss(kind, network, batch, **options):
    """Return TorchRL's loss with copies of our networks, and its output for `batch`."""
    actor = deepcopy(network.actor)[1:]
    choices = kind is DiscreteSACLoss
    reads = [("agents", "features"), *([] if choices else [("agents", "action")])]
    name = "action_value" if choices else "state_action_value"
    critics = [
        TensorDictModule(Value(deepcopy(critic)), in_keys=reads, out_keys=[("agents", name)])
        for critic in network.values.critics
    ]
    loss = kind(actor, critics, loss_function="l2", alpha_init=ALPHA, **options)
    keys = {k: ("agents", k) for k in ("action", "reward", "done", "terminated", name)}
    loss.set_keys(**keys, **({} if kind is CrossQLoss else {"value": ("agents", "value")}))
    loss.make_value_estimator(ValueEstimators.TD0, gamma=GAMMA)
    if kind is not CrossQLoss:
        SoftUpdate(loss, tau=0.5)
        loss.target_qvalue_network_params.apply_(lambda array: array.mul_(0.8))
    ended = batch.discount == 0.0
    step = {
        "features": batch.last["agents", "observation", "state"],
        "reward": batch.returns.unsqueeze(-1),
        "done": ended.unsqueeze(-1),
        "terminated": ended.unsqueeze(-1),
    }
    rows = {
        "features": batch.first["agents", "observation", "state"],
        "action": batch.first["agents", "action"],
    }
    torch.manual_seed(11)
    return loss, loss(TensorDict({"agents": rows, "next": {"agents": step}}, batch.first.shape))


def assert_same_gradients(ours, theirs):
    assert len(ours) == len(theirs) > 0
    for one, other in zip(ours, theirs, strict=True):
        torch.testing.assert_close(one.grad, other.grad)


@pytest.mark.parametrize(
    ("kind", "actions", "options"),
    [
        (SACLoss, CONTINUOUS, {"target_entropy": -2.0}),
        (CrossQLoss, CONTINUOUS, {"target_entropy": -2.0}),
        (
            DiscreteSACLoss,
            DISCRETE,
            {"action_space": "categorical", "num_actions": 3, "target_entropy_weight": 0.3},
        ),
    ],
    ids=["continuous", "crossq", "discrete"],
)
def test_losses_and_gradients_equal_those_of_torchrl(kind, actions, options):
    batch = transitions_of(actions)
    own = {"kind": TeamCrossQLoss, "critic": RENORMALISED} if kind is CrossQLoss else {}
    loss, network = loss_of(actions, **own)
    theirs, expected = torchrl_loss(kind, network, batch, **options)
    torch.manual_seed(11)
    if loss.averages:  # their encoder is not in the target
        for parameter in loss.target.encoder.parameters():
            parameter.fill_(1.0)
    found = loss(batch)
    torch.testing.assert_close(found.critic, expected["loss_qvalue"])
    torch.testing.assert_close(found.policy, expected["loss_actor"])
    torch.testing.assert_close(found.temperature, expected["loss_alpha"])
    torch.testing.assert_close(found.measures["entropy"], expected["entropy"])

    (found.critic + found.policy + found.temperature).backward()
    (expected["loss_qvalue"] + expected["loss_actor"] + expected["loss_alpha"]).backward()
    policy = list(theirs.actor_network_params.values(True, True))
    ours = TensorDict.from_module(network.actor[1:]).values(True, True)
    assert_same_gradients(list(ours), policy)
    stacked = theirs.qvalue_network_params["module", "layers"]
    for index, critic in enumerate(network.values.critics):
        for name, parameter in critic.named_parameters():
            expected_grad = stacked[tuple(name.split("."))].grad[index]
            torch.testing.assert_close(parameter.grad, expected_grad)
    (log_alpha,) = loss.temperatures.parameters()
    torch.testing.assert_close(log_alpha.grad, theirs.log_alpha.grad)


def soft_value_by_integration(loss, network, state):
    """Return the soft value of one observation, an integral over the movement on a grid."""
    rows = TensorDict({"agents": {"features": state}}, state.shape[:-2])
    for head in network.actor.module[1:-1]:
        head(rows)
    parameters = rows["agents", "parameters"]
    normal = Normal(parameters["move", "loc"], parameters["move", "scale"])
    grid = torch.linspace(-9.0, 9.0, 20001)
    density = normal.log_prob(grid).squeeze().exp()
    log_prob = normal.log_prob(grid).squeeze() - torch.log1p(-torch.tanh(grid).square() + 1e-12)
    moves = torch.tanh(grid).reshape(-1, 1, 1)
    values = network.values(state.expand(len(grid), 1, WIDTH), moves).amin(0).squeeze(1)
    log_choice = parameters["voice", "logits"].squeeze().log_softmax(-1)
    soft = (log_choice.exp() * (values - ALPHA * log_choice)).sum(-1) - ALPHA * log_prob
    return torch.trapezoid(density * soft, grid)


def test_the_soft_value_of_a_mixed_action_and_its_gradient_equal_an_integral():
    loss, network = loss_of(HYBRID, agents=1)
    state = torch.tensor([[[0.4, -0.3, 0.8, -0.6]]])
    exact = soft_value_by_integration(loss, network, state)
    policy = list(loss.policy.parameters())
    gradient = torch.autograd.grad(exact, policy)

    torch.manual_seed(0)
    many = transitions_of(HYBRID, rows=20_000, agents=1)
    many.first["agents", "observation", "state"] = state.expand(20_000, 1, WIDTH).clone()
    found = loss(many)
    torch.testing.assert_close(-found.policy, exact, atol=0.01, rtol=0.01)
    sampled = torch.autograd.grad(-found.policy, policy)
    for one, other in zip(sampled, gradient, strict=True):
        torch.testing.assert_close(one, other, atol=0.02, rtol=0.02)


def test_the_gradient_of_the_entropy_of_choices_is_exact():
    """TorchRL's `SACLoss` of a composite distribution has (.002, .001, -.001, -.001) here."""
    actions = {"move": ActionLayout(False, 1), "voice": ActionLayout(True, 4)}
    loss, network = loss_of(actions, agents=1)
    layer = network.actor.module[2].module[-1]  # logits of the voice
    with torch.no_grad():
        for critic in network.values.critics:
            critic[-1].weight.zero_()  # all choices have the same value
            critic[-1].bias.zero_()
        layer.weight.zero_()
        layer.bias.copy_(torch.tensor([1.5, 0.0, 0.0, 0.0]))
    loss(transitions_of(actions, agents=1)).policy.backward()
    p = layer.bias.softmax(-1).detach()
    entropy = -(p * p.log()).sum()
    torch.testing.assert_close(layer.bias.grad, ALPHA * p * (p.log() + entropy))


def gradients(loss, of, parts):
    """Return for each part of the network whether the loss `of` has a gradient there."""
    for part in parts:
        part.zero_grad()
    getattr(loss(transitions_of(HYBRID)), of).backward()
    return [
        any(p.grad is not None and bool(p.grad.any()) for p in part.parameters()) for part in parts
    ]


@pytest.mark.parametrize("gradient", EncoderGradient)
def test_each_loss_trains_its_own_part(gradient):
    loss, network = loss_of(HYBRID, gradient)
    parts = [network.encoder, network.actor[1:], network.values]
    assert gradients(loss, "critic", parts) == [True, False, True]
    expected = gradient is EncoderGradient.both
    assert gradients(loss, "policy", parts) == [expected, True, False]


@pytest.mark.parametrize(
    ("kind", "critic", "factory"),
    [
        (TeamSACLoss, CRITIC, Central),
        (TeamCrossQLoss, RENORMALISED, PlainNetwork),
        (TeamCrossQLoss, RENORMALISED, Central),
    ],
)
def test_entries_that_do_not_count_change_nothing(kind, critic, factory):
    batch = transitions_of(HYBRID)
    eliminated = (slice(0, 3), 1)
    for rows in (batch.first, batch.last):
        rows["agents", "mask"] = rows["agents", "mask"].clone()
        rows["agents", "mask"][eliminated] = False
    counted = batch.counted.clone()
    counted[eliminated] = False
    found = []
    for value in (0.0, 50.0):
        for rows in (batch.first, batch.last):
            rows["agents", "observation", "state"][eliminated] = value
        batch.returns[eliminated] = value
        loss, _ = loss_of(HYBRID, factory=factory, kind=kind, critic=critic)
        torch.manual_seed(0)
        losses = loss(Transitions(**vars(batch) | {"counted": counted}))
        found.append(torch.stack([losses.critic, losses.policy, losses.temperature]))
    torch.testing.assert_close(*found)


def test_a_central_critic_reads_what_the_others_do_and_an_own_one_does_not():
    changes = {}
    for factory in (PlainNetwork, Central):
        loss, _ = loss_of(HYBRID, factory=factory)
        found = []
        for choice in (0, 2):
            batch = transitions_of(HYBRID)
            batch.first["agents", "action", "voice"][:, 1] = choice
            torch.manual_seed(0)
            alone = batch.counted.clone()
            alone[:, 1] = False  # the loss of the first agent
            found.append(loss(Transitions(**vars(batch) | {"counted": alone})).critic)
        changes[factory] = not torch.equal(*found)
    assert changes == {PlainNetwork: False, Central: True}


def test_a_temperature_rises_where_the_entropy_is_below_its_target():
    temperatures = Temperatures(HYBRID, LEARNT)
    low = {part: torch.full((1, 2), -9.0) for part in HYBRID}
    temperatures.loss(low, torch.ones(1, 2, dtype=torch.bool)).backward()
    assert all(p.grad < 0.0 for p in temperatures.parameters())
    torch.testing.assert_close(
        temperatures.targets, {"move": -1.0, "voice": 0.3 * float(torch.tensor(3.0).log())}
    )


def test_a_learnt_temperature_stays_above_its_minimum():
    cfg = replace(LEARNT, minimum=0.5 * ALPHA)
    temperatures = Temperatures(HYBRID, cfg)
    optimizer = torch.optim.SGD(temperatures.parameters(), lr=1.0)
    high = {part: torch.full((1, 2), 9.0) for part in HYBRID}
    temperatures.loss(high, torch.ones(1, 2, dtype=torch.bool)).backward()
    optimizer.step()
    assert all(alpha < 0.5 * ALPHA for alpha in temperatures.alphas().values())
    temperatures.project()
    assert temperatures.alphas() == {part: pytest.approx(0.5 * ALPHA) for part in HYBRID}


@pytest.mark.parametrize("minimum", [-1.0, 2.0 * ALPHA])
def test_an_impossible_minimum_of_the_temperature_is_refused(minimum):
    with pytest.raises(ValueError, match=r"temperature\.minimum"):
        replace(LEARNT, minimum=minimum)


def test_batch_statistics_are_those_of_the_entries_that_count_also_of_separate_critics():
    class Separate(PlainNetwork):
        def per_agent(self, make, ranks=(1,)):
            return PerAgent(make, self.spec.agents, ranks)

    _, network = loss_of(HYBRID, factory=Separate, kind=TeamCrossQLoss, critic=RENORMALISED)
    layers = [m for m in network.values.modules() if isinstance(m, BatchRenorm)]
    x, counted = torch.randn(6, 2, 16), torch.ones(6, 2, dtype=torch.bool)
    counted[2:, 1] = False
    with statistics_of(network.values, counted):
        for i, layer in enumerate(layers):
            layer(x[:, i % 2 : i % 2 + 1])
    for i, layer in enumerate(layers):
        assert layer.counted is None
        agent = i % 2
        mean = x[counted[:, agent], agent].mean(0)
        torch.testing.assert_close(layer.layer.running_mean, layer.layer.momentum * mean)


@pytest.mark.parametrize("present", [0, 1])
def test_a_batch_of_one_entry_or_none_has_no_statistics(present):
    layer = BatchRenorm(4)
    before = layer.layer.running_mean.clone()
    layer.counted = torch.zeros(5, 2, dtype=torch.bool)
    layer.counted[:present, 0] = True
    assert not layer(torch.randn(5, 2, 4)).any()
    torch.testing.assert_close(layer.layer.running_mean, before)


def test_batch_renormalisation_corrects_fully_after_its_warm_up_and_not_more():
    """TorchRL's own count goes on, and doubles the correction after twice the warm-up."""
    torch.manual_seed(0)
    layer = BatchRenorm(3)
    layer.layer.warmup_steps = 5
    layer.layer.running_mean.fill_(1.0)
    for _ in range(12):
        x = torch.randn(4, 2, 3) + 1.0
        mean, variance = layer.layer.running_mean.clone(), layer.layer.running_var.clone()
        found = layer(x)
    # with the statistics of the whole history; those of one batch have been cancelled
    expected = (x - mean) / (variance + layer.layer.eps).sqrt()
    torch.testing.assert_close(found, expected)
    assert int(layer.layer.num_batches_tracked) == 5


def test_running_statistics_are_the_mean_over_all_batches_at_first():
    torch.manual_seed(0)
    norm = BatchRenorm(3)
    batches = torch.randn(20, 64, 3) * 5.0 + 100.0
    for batch in batches:
        norm(batch)
    torch.testing.assert_close(norm.layer.running_mean, batches.mean((0, 1)))
    torch.testing.assert_close(norm.layer.running_var, batches.var(1).mean(0))
    norm.eval()
    rows = norm(batches.flatten(0, 1))
    assert rows.mean().abs() < 0.1
    assert (rows.std(0) - 1.0).abs().max() < 0.1


def test_running_statistics_forget_one_hundredth_with_each_batch_later():
    norm = BatchRenorm(1)
    norm.layer.num_batches_tracked.fill_(500)
    norm.layer.running_mean.fill_(0.0)
    norm(torch.randn(64, 1) + 100.0)
    assert float(norm.layer.running_mean) == pytest.approx(1.0, abs=0.02)


def test_target_networks_move_by_the_given_fraction():
    loss, _ = loss_of(HYBRID)
    with torch.no_grad():
        for parameter in loss.critic.parameters():
            parameter.add_(torch.randn_like(parameter))
    before = [parameter.clone() for parameter in loss.target.parameters()]
    learnt = [parameter.clone() for parameter in loss.critic.parameters()]
    loss.target.approach(loss.critic, 0.25)
    for old, new, own in zip(before, learnt, loss.target.parameters(), strict=True):
        torch.testing.assert_close(own, 0.75 * old + 0.25 * new)
    for parameter, same in zip(loss.critic.parameters(), learnt, strict=True):
        assert torch.equal(parameter, same)
