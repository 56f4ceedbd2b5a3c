"""bfloat16 rounds to 8 significant bits; features and gradients stay within that of float32."""

from copy import deepcopy

import pytest
import torch
from fake_env import FakeEnv
from torchrl.envs import ExplorationType, set_exploration_type

from veca_marl.algos.networks.encoders import Precision, for_acting, has_bfloat16
from veca_marl.algos.networks.multisense import MultisenseCfg, Trunk
from veca_marl.algos.specs import ArrayLayout

CPU = torch.device("cpu")
LAYOUTS = {
    "vision": ArrayLayout((2, 3, 36, 36), "uint8", 0.0, 255.0),
    "audio": ArrayLayout((2, 20), "float32", -8.0, 3.0),
}
ROUNDING = 2.0**-8  # of one number; errors of all layers add up to at most 4.3 times that (9 seeds)


@pytest.fixture
def observations():
    torch.manual_seed(0)
    image = torch.randint(0, 256, (16, 1, *LAYOUTS["vision"].shape), dtype=torch.uint8)
    return image, torch.rand(16, 1, 2, 20) * 11.0 - 8.0


def trunk(precision):
    torch.manual_seed(1)
    return Trunk(LAYOUTS, MultisenseCfg(precision=precision))


def gradient(precision, observations):
    net = trunk(precision)
    features = net(*observations)
    assert features.dtype == torch.float32
    features.square().sum().backward()
    assert all(p.grad.dtype == p.dtype == torch.float32 for p in net.parameters())
    return features.detach(), torch.cat([p.grad.flatten() for p in net.parameters()])


def test_features_and_gradients_in_bfloat16_are_those_of_float32_but_for_rounding(observations):
    exact = gradient(Precision.float32, observations)
    rounded = gradient(Precision.bfloat16, observations)
    for one, other in zip(exact, rounded, strict=True):
        error = (one - other).norm() / one.norm()
        assert 0.0 < error < 8 * ROUNDING


def test_copies_that_act_compute_in_float32(observations):
    acting = [for_acting(deepcopy(trunk(precision)))(*observations) for precision in Precision]
    for features in acting:
        assert torch.equal(features, acting[0])
    learning = trunk(Precision.bfloat16)
    for_acting(deepcopy(learning))
    assert (learning(*observations) != acting[0]).any(), "the original keeps its arithmetic"


def test_rounding_is_far_below_the_divergence_that_steers_the_learning_rate(make_ppo):
    """The batch is collected in float32 and learnt from in bfloat16."""
    network = MultisenseCfg(precision=Precision.bfloat16)
    learners = make_ppo(network=network, image=36)
    ppo, env = learners.algorithms["agents"], FakeEnv(4, image=36)

    @torch.no_grad()
    def play():
        with set_exploration_type(ExplorationType.RANDOM):
            return env.rollout(32, learners.policy.copy().collect, break_when_any_done=False)

    spread = play()["agents", "loc"].std()
    with torch.no_grad():  # the policy depends on what it sees, as after learning
        for head in ppo.network.actor[1].parameters():
            head.mul_(0.5 / spread)
    batch = play()
    assert batch["agents", "loc"].std() > 0.3
    out = ppo.loss(ppo.prepare(batch))
    assert 0.0 < out["kl_approx"] < 0.05 * ppo.cfg.target_kl
    assert out["clip_fraction"] == 0.0


@pytest.mark.parametrize(
    ("capabilities", "chosen"),
    [
        ({"avx512_bf16": True}, Precision.bfloat16),
        ({"amx_bf16": True, "avx512_bf16": False}, Precision.bfloat16),
        ({"avx512_f": True, "avx512_bf16": False}, Precision.float32),
        ({"neon": True}, Precision.float32),
    ],
)
def test_auto_is_bfloat16_where_the_processor_has_instructions_for_it(
    capabilities, chosen, monkeypatch
):
    monkeypatch.setattr(torch.cpu, "get_capabilities", lambda: capabilities)
    assert Precision.auto.on(CPU) is chosen
    assert Precision.float32.on(CPU) is Precision.float32
    assert Precision.bfloat16.on(CPU) is Precision.bfloat16


@pytest.mark.parametrize("supported", [True, False])
def test_a_cuda_device_needs_the_instructions_too(supported, monkeypatch):
    monkeypatch.setattr(torch.cpu, "get_capabilities", lambda: {"amx_bf16": True})
    monkeypatch.setattr(torch.cuda, "is_bf16_supported", lambda **_: supported)
    assert has_bfloat16(torch.device("cuda")) is supported
