import math

import pytest
import torch
from fake_env import FakeEnv
from refusals import naming
from torchrl.data import Bounded, Composite

from veca_marl.algos.checkpoints import from_plain, to_plain
from veca_marl.algos.networks.encoders import (
    Convolutions,
    ImageEncoder,
    Pooling,
    Precision,
    SpatialSoftmax,
    VectorEncoder,
    make_encoder,
    scale_of,
)
from veca_marl.algos.networks.factory import make_network
from veca_marl.algos.networks.multisense import MultisenseCfg, Trunk
from veca_marl.algos.specs import ArrayLayout, team_specs

IMAGE = ArrayLayout((2, 3, 84, 84), "uint8", 0.0, 255.0)
SPECTRUM = ArrayLayout((2, 250), "float32", -8.0, 3.0)


def network(cfg=None, **env):
    fake = FakeEnv(**env)
    return fake, make_network("agents", team_specs(fake)["agents"], cfg or MultisenseCfg())


def test_encoder_is_chosen_by_type_and_shape():
    assert isinstance(make_encoder("a", IMAGE, Convolutions(), 64, Pooling.flatten), ImageEncoder)
    assert isinstance(
        make_encoder("b", SPECTRUM, Convolutions(), 64, Pooling.flatten), VectorEncoder
    )
    # depth is not bytes: it has no colour channels to stack
    assert isinstance(
        make_encoder(
            "c", ArrayLayout((2, 8, 8), "float32", 0.0, 9.0), Convolutions(), 64, Pooling.flatten
        ),
        VectorEncoder,
    )
    with pytest.raises(ValueError, match=naming("touch", "int64(3,)", "uint8")):
        make_encoder("touch", ArrayLayout((3,), "int64", 0, 1), Convolutions(), 64, Pooling.flatten)


@pytest.mark.parametrize("size", [(84, 84), (36, 36), (20, 31), (4, 4), (120, 96)])
def test_images_of_any_size_are_encoded(size):
    encoder = ImageEncoder((2, 3, *size))
    image = torch.randint(0, 256, (3, 2, 3, *size), dtype=torch.uint8)
    assert encoder(image).shape == (3, encoder.features)


def test_image_encoder_has_the_documented_layers():
    encoder = ImageEncoder(IMAGE.shape)
    shapes = [tuple(p.shape) for p in encoder.parameters() if p.ndim == 4]
    assert shapes == [(16, 6, 4, 4), (32, 16, 4, 4), (32, 32, 3, 3)]
    assert encoder.features == 32 * 7 * 7


def test_sizes_of_convolutions_are_chosen():
    cfg = MultisenseCfg(channels=[8, 16, 16], kernels=[8, 4, 3], strides=[4, 2, 2])
    encoder = ImageEncoder(IMAGE.shape, cfg.convolutions)
    shapes = [tuple(p.shape) for p in encoder.parameters() if p.ndim == 4]
    assert shapes == [(8, 6, 8, 8), (16, 8, 4, 4), (16, 16, 3, 3)]
    assert encoder.features == 16 * 4 * 4


@pytest.mark.parametrize("name", ["channels", "kernels", "strides"])
@pytest.mark.parametrize("numbers", [[4, 4], [4, 0, 3]])
def test_impossible_sizes_of_convolutions_are_refused(name, numbers):
    with pytest.raises(ValueError, match=naming(f"network.{name}", numbers)):
        MultisenseCfg(**{name: numbers})


def test_a_stored_network_is_read_and_a_field_it_lacks_has_its_default():
    plain = to_plain(MultisenseCfg(kernels=[8, 4, 3]))
    read = from_plain(MultisenseCfg, plain, lambda base, name: MultisenseCfg)
    assert read == MultisenseCfg(kernels=[8, 4, 3])
    del plain["kernels"]
    assert from_plain(MultisenseCfg, plain, lambda base, name: MultisenseCfg) == MultisenseCfg()


def test_bytes_are_encoded_as_numbers_from_0_to_1():
    torch.manual_seed(0)
    encoder = ImageEncoder(IMAGE.shape)
    image = torch.randint(0, 256, (3, *IMAGE.shape), dtype=torch.uint8)
    x = image.flatten(1, 2) / 255.0
    for layer, stride in zip(encoder.layers[::2], (4, 2, 1), strict=False):
        x = torch.relu(torch.nn.functional.conv2d(x, layer.weight, layer.bias, stride))
    torch.testing.assert_close(encoder(image), x.flatten(1), rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize(
    ("compressed", "low", "high", "expected"),
    [
        (True, -8.0, 4.0, [-1.0, 0.0, 1.0]),
        (False, -math.inf, math.inf, [-8.0, -2.0, 4.0]),
        (True, -math.inf, math.inf, [-math.log(9.0), -math.log(3.0), math.log(5.0)]),
    ],
)
def test_bounded_arrays_are_scaled_and_unbounded_ones_optionally_compressed(
    compressed, low, high, expected
):
    scale = scale_of(ArrayLayout((3,), "float32", low, high), compressed)
    torch.testing.assert_close(scale(torch.tensor([-8.0, -2.0, 4.0])), torch.tensor(expected))


def test_only_configured_senses_are_compressed():
    """Of the senses of a world: spectra are in decades already, and proprioception is not."""
    layouts = {
        "audio": ArrayLayout((2, 250), "float32", -math.inf, math.inf),
        "proprioception": ArrayLayout((534,), "float32", -math.inf, math.inf),
    }
    encoders = Trunk(layouts, MultisenseCfg()).encoders
    hundred = torch.tensor([100.0])
    assert encoders["audio"].scale(hundred) == hundred
    assert encoders["proprioception"].scale(hundred) == pytest.approx(math.log(101.0))


@pytest.mark.parametrize("left_out", ["vision", "audio"])
def test_an_absent_sense_has_no_parameters(left_out):
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
    env, net = network(MultisenseCfg(precision=precision), discrete=discrete, agents=3)
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
    features = net.encoder(td)["agents", "features"]
    torch.testing.assert_close(features[:, 0], features[:, 1])


@pytest.mark.parametrize("scale", [0.3, 1.0])
def test_first_actions_have_the_configured_standard_deviation(scale):
    torch.manual_seed(0)
    env, net = network(MultisenseCfg(initial_scale=scale))
    first = net.actor(env.reset())["agents", "scale"]
    # the gain of the last layer is 0.01
    torch.testing.assert_close(first, torch.full_like(first, scale), rtol=0.1, atol=0.0)


def test_unsupported_actions_raise_an_error_with_the_choices():
    env = FakeEnv(worlds=1)
    wide = Bounded(-2.0, 2.0, shape=(1, 1, 2))
    env.action_spec = Composite(agents=Composite(action=wide, shape=(1, 1)), shape=(1,))
    with pytest.raises(ValueError, match=r"(?s)'agents'.*Bounded.*Categorical"):
        team_specs(env)


@pytest.mark.parametrize(
    ("kwargs", "parts"),
    [
        ({"trunk_features": 0}, ("network", "trunk_features=0")),
        ({"initial_scale": 0.0}, ("initial_scale", "0.01", "0.0")),
        ({"initial_scale": math.inf}, ("initial_scale", "0.01", " inf")),
    ],
)
def test_invalid_sizes_raise_an_error(kwargs, parts):
    with pytest.raises(ValueError, match=naming(*parts)):
        MultisenseCfg(**kwargs)


def test_places_are_positions_of_activations():
    maps = torch.zeros(2, 3, 5, 9)
    maps[0, 0, 0, 8] = maps[0, 1, 4, 4] = 40.0
    right, down, bright = SpatialSoftmax(3)(maps).reshape(2, 3, 3).unbind(1)
    torch.testing.assert_close(right[0], torch.tensor([1.0, 0.0, 0.0]), atol=1e-5, rtol=0.0)
    torch.testing.assert_close(down[0], torch.tensor([-1.0, 1.0, 0.0]), atol=1e-5, rtol=0.0)
    torch.testing.assert_close(bright[0], torch.tensor([40.0, 40.0, 0.0]))
    torch.testing.assert_close(right[1], torch.zeros(3), atol=1e-6, rtol=0.0)  # dark: the middle


@pytest.mark.parametrize("shape", [(3, 84, 84), (2, 3, 21, 40), (1, 8, 6)])
def test_places_accept_any_size(shape):
    encoder = ImageEncoder(shape, Convolutions((4, 8, 8)), Pooling.places)
    features = encoder(torch.randint(0, 256, (5, *shape), dtype=torch.uint8))
    assert features.shape == (5, encoder.features) == (5, 24)
    features.sum().backward()
    assert all(p.grad is not None for p in encoder.parameters())


def test_places_learn_a_position_from_fewer_images():
    """An orange square of 6 x 6 pixels somewhere in grey noise: its column, from 64 images.

    The ratio of the errors is 0.32 to 0.67 with 16 seeds.
    """
    torch.manual_seed(0)
    columns = torch.randint(0, 58, (256,))
    images = torch.randint(60, 120, (256, 3, 64, 64), dtype=torch.uint8)
    for image, left in zip(images, columns, strict=True):
        image[:, 20:26, left : left + 6] = torch.tensor([250, 110, 20])[:, None, None]
    wanted = (columns.float() / 29.0 - 1.0)[:, None]

    def error(pooling):
        torch.manual_seed(1)
        encoder = ImageEncoder((3, 64, 64), Convolutions((8, 16, 16)), pooling)
        model = torch.nn.Sequential(encoder, torch.nn.Linear(encoder.features, 1))
        optimizer = torch.optim.Adam(model.parameters(), 3e-3)
        for batch in torch.randint(0, 64, (100, 32)):
            loss = (model(images[batch]) - wanted[batch]).square().mean()
            optimizer.zero_grad()
            loss.backward()
            optimizer.step()
        with torch.no_grad():
            return (model(images[64:]) - wanted[64:]).square().mean().sqrt().item()

    assert error(Pooling.places) < 0.85 * error(Pooling.flatten)
