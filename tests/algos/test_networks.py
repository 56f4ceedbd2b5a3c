import pytest
import torch
from fake_env import FakeEnv
from torchrl.data import Bounded, Composite

from veca_marl.algos.encoders import ImageEncoder, VectorEncoder, make_encoder
from veca_marl.algos.networks import NetworkCfg, Precision, TeamNetwork
from veca_marl.algos.specs import ArrayLayout, team_specs

IMAGE = ArrayLayout((2, 3, 84, 84), "uint8", 0.0, 255.0)
SPECTRUM = ArrayLayout((2, 250), "float32", -8.0, 3.0)


def network(cfg=None, **env):
    fake = FakeEnv(**env)
    return fake, TeamNetwork("agents", team_specs(fake)["agents"], cfg or NetworkCfg())


def test_encoder_is_chosen_by_what_the_array_looks_like():
    assert isinstance(make_encoder("a", IMAGE, (16, 32, 32), 64), ImageEncoder)
    assert isinstance(make_encoder("b", SPECTRUM, (16, 32, 32), 64), VectorEncoder)
    # depth is not bytes: it has no colour channels to stack
    assert isinstance(
        make_encoder("c", ArrayLayout((2, 8, 8), "float32", 0.0, 9.0), (16, 32, 32), 64),
        VectorEncoder,
    )
    with pytest.raises(ValueError, match=r"touch: no encoder for int64\(3,\); choices: uint8"):
        make_encoder("touch", ArrayLayout((3,), "int64", 0, 1), (16, 32, 32), 64)


@pytest.mark.parametrize("size", [(84, 84), (36, 36), (20, 31), (4, 4), (120, 96)])
def test_images_of_any_size_are_encoded(size):
    encoder = ImageEncoder((2, 3, *size))
    image = torch.randint(0, 256, (3, 2, 3, *size), dtype=torch.uint8)
    assert encoder(image).shape == (3, encoder.features)


def test_image_encoder_has_the_layers_of_the_design():
    encoder = ImageEncoder(IMAGE.shape)
    shapes = [tuple(p.shape) for p in encoder.parameters() if p.ndim == 4]
    assert shapes == [(16, 6, 8, 8), (32, 16, 4, 4), (32, 32, 3, 3)]
    assert encoder.features == 32 * 7 * 7


def test_blocks_of_images_are_encoded_as_all_at_once():
    torch.manual_seed(0)
    encoder = ImageEncoder(IMAGE.shape)
    image = torch.randint(0, 256, (70, *IMAGE.shape), dtype=torch.uint8)
    whole = encoder.layers(image.flatten(1, 2) / 255.0)
    torch.testing.assert_close(encoder(image), whole, rtol=1e-5, atol=1e-6)


def test_bounded_vectors_are_mapped_to_one_and_unbounded_pass():
    seen = []
    for low, high in ((-8.0, 3.0), (float("-inf"), float("inf"))):
        encoder = VectorEncoder(ArrayLayout((3,), "float32", low, high))
        encoder.layers = torch.nn.Identity()
        seen.append(encoder(torch.tensor([[-8.0, -2.5, 3.0]])))
    torch.testing.assert_close(seen[0], torch.tensor([[-1.0, 0.0, 1.0]]))
    torch.testing.assert_close(seen[1], torch.tensor([[-8.0, -2.5, 3.0]]))


@pytest.mark.parametrize("left_out", ["vision", "audio"])
def test_a_sense_that_is_not_there_leaves_no_parameters(left_out):
    kept = {"vision", "audio"} - {left_out}
    _, both = network()
    _, one = network(senses=tuple(kept))
    names = {name for name, _ in one.named_parameters()}
    assert not any(left_out in name for name in names)
    assert any(next(iter(kept)) in name for name in names)
    assert sum(p.numel() for p in one.parameters()) < sum(p.numel() for p in both.parameters())


@pytest.mark.parametrize("discrete", [False, True])
@pytest.mark.parametrize("precision", list(Precision))
def test_actor_acts_within_the_spec_for_every_agent(discrete, precision):
    env, net = network(NetworkCfg(precision=precision), discrete=discrete, agents=3)
    out = net.actor(env.reset())
    assert env.full_action_spec["agents", "action"].is_in(out["agents", "action"])
    assert out["agents", "action_log_prob"].shape == (4, 3)
    value = net.critic(out)["agents", "state_value"]
    assert value.shape == (4, 3, 1)
    assert value.dtype == torch.float32


def test_agents_of_a_team_share_one_policy():
    env, net = network(agents=2)
    td = env.reset()
    for name in ("vision", "audio"):
        array = td["agents", "observation", name]
        array[:, 1] = array[:, 0]
    features = net.trunk(td)["agents", "features"]
    torch.testing.assert_close(features[:, 0], features[:, 1])


def test_unlearnable_actions_are_refused_with_the_choices():
    env = FakeEnv(worlds=1)
    wide = Bounded(-2.0, 2.0, shape=(1, 1, 2))
    env.action_spec = Composite(agents=Composite(action=wide, shape=(1, 1)), shape=(1,))
    with pytest.raises(ValueError, match=r"(?s)team 'agents': cannot learn .* choices: Bounded in"):
        team_specs(env)


@pytest.mark.parametrize(
    ("kwargs", "message"),
    [({"channels": [1, 2]}, "need 3 numbers"), ({"trunk_features": 0}, "must be positive")],
)
def test_impossible_sizes_are_refused(kwargs, message):
    with pytest.raises(ValueError, match=message):
        NetworkCfg(**kwargs)
