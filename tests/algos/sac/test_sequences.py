"""SAC of networks with hidden state: windows, burn-in, gradients through time, a memory task."""

import math
from dataclasses import replace
from functools import partial

import pytest
import torch
from cue import make_cue
from fake_env import make_fake_env
from refusals import naming
from tensordict import TensorDict
from timed_batches import SPEC, batch_of
from training import SMALL

from veca_marl.algos.collection.experience import CollectCfg, Experience
from veca_marl.algos.evaluation.evaluate import Exploration, evaluate
from veca_marl.algos.networks.action_values import ActionValuesCfg, Normalisation
from veca_marl.algos.networks.encoders import Precision
from veca_marl.algos.networks.memory import with_memory
from veca_marl.algos.networks.multisense import Critic, Memory, Parameters
from veca_marl.algos.sac.config import EncoderGradient, ReplayCfg, SACCfg, Targets
from veca_marl.algos.sac.readers import SequenceReader
from veca_marl.algos.sac.replay import VALID, Replay, Span, StoredKeys, storage_needed, transitions
from veca_marl.algos.sac.sac import SAC
from veca_marl.algos.specs import team_specs

CPU = torch.device("cpu")
GRU = replace(SMALL, memory=Memory.gru, memory_features=16, precision=Precision.float32)
WHOLE = {"break_when_any_done": False}
HIDDEN = ("agents", "memory", "hidden")
NUMBERS = {
    "critic": ActionValuesCfg(hidden=[32]),
    "policy_hidden": [32],
    "replay": ReplayCfg(capacity=4000, warm_up_frames=256),
    "learning_rate": 2e-3,
    "tau": 0.02,
    "gamma": 0.9,
    "sequence_steps": 8,
    "burn_in": 2,
}


def targets_of(span):
    """Return what is learnt about the first agent, and how often each target was drawn."""
    torch.manual_seed(0)
    replay = Replay(StoredKeys.of("team", SPEC), ReplayCfg(200, 0), span)
    for start in (0.0, 20.0):
        replay.extend(batch_of(steps=8, done=[(0, 4)], terminated=[(1, 2)], start=start))
    found = transitions(replay.sample(4096), "team", 0.5)
    time = ("team", "observation", "time")
    rows = torch.stack([found.first[time], found.last[time], found.returns, found.discount], -1)
    return torch.unique(rows[:, 0][found.counted[:, 0]], dim=0, return_counts=True)


@pytest.mark.parametrize("span", [Span(0, 4, 3), Span(2, 4, 3), Span(3, 16, 3)])
def test_targets_of_sequences_are_those_of_single_steps_and_are_drawn_alike(span):
    targets, counts = targets_of(span)
    expected, _ = targets_of(Span(0, 1, 3))
    assert torch.equal(targets, expected)
    assert len(targets) == 32
    mean = counts.float().mean()
    assert (counts - mean).abs().max() < 5.0 * mean.sqrt()  # also of the steps of short parts


def make_env(worlds, seed):
    """Episodes of 12 steps; an observation depends on the world and the step."""
    return make_fake_env(worlds, seed, horizon=12, agents=2, senses=("audio",))


def sampled(network=GRU, span=(3, 4, 2)):
    """Return SAC, its reader, and a batch of transitions collected with its own parameters."""
    torch.manual_seed(0)
    cfg = SACCfg(network=network, batch_size=64, **NUMBERS)
    cfg = replace(cfg, burn_in=span[0], sequence_steps=span[1], steps=span[2])
    sac = SAC("agents", team_specs(make_env(1, 0))["agents"], cfg, CPU)
    experience = Experience(make_env, sac.actor, CollectCfg(1, worlds=4, steps=16, processes=0))
    experience.restart(0)
    for _ in range(3):
        sac.replay.extend(experience.collect())
    experience.close()
    windows = sac.replay.sample(64 // span[1] * 4)
    return (
        sac,
        SequenceReader("agents", (HIDDEN,), Span(*span)),
        transitions(windows, "agents", 0.9),
    )


@pytest.mark.parametrize(
    "network",
    [
        GRU,
        replace(GRU, parameters=Parameters.separate),
        replace(GRU, memory=Memory.gru_shortcut),
    ],
)
def test_features_are_the_states_that_were_stored(network):
    """As long as parameters have not changed, every state after a step equals the stored one."""
    sac, reader, batch = sampled(network)
    rows, span = batch.sequences, Span(3, 4, 2)
    # with a shortcut other features precede the states
    size = network.memory_features
    before, after = (x[..., -size:] for x in reader.online(sac.network.encoder, batch))
    stored, valid = rows[HIDDEN], rows[VALID]
    learnt = slice(span.learnt.start + 1, span.learnt.stop + 1)  # the state before the next step
    known = valid[:, learnt].flatten()
    torch.testing.assert_close(before[known], stored[:, learnt].flatten(0, 1)[known])
    last = slice(span.following.start + 1, span.following.stop + 1)
    known = torch.cat([valid, torch.zeros_like(valid[:, :1])], 1)[:, last].flatten()
    following = torch.cat([stored, stored[:, :1]], 1)[:, last].flatten(0, 1)
    torch.testing.assert_close(after[known], following[known])
    assert known.any()
    assert not valid[:, 0].all(), "some windows must begin before their segment"
    assert not valid.all(0)[-1], "some windows must end after it"


def test_a_target_that_a_segment_cuts_short_reads_its_last_observation():
    sac, reader, batch = sampled(span=(0, 4, 4))
    rows, encoder = batch.sequences, sac.network.encoder
    _, after = reader.online(encoder, batch)
    window = int((rows[VALID].sum(1) == 5).nonzero()[0])  # four steps and the last observation
    own = rows[window : window + 1]
    state = own[HIDDEN][:, 0]
    for step in range(5):
        row = own[:, step].select(*encoder.in_keys)
        row[HIDDEN] = state
        with torch.no_grad():
            state = encoder(row)["agents", "features"]
    torch.testing.assert_close(after.unflatten(0, (-1, 4))[window], state.expand(4, -1, -1))


def test_burn_in_repairs_a_state_that_older_parameters_stored():
    errors = {}
    for burn_in in (0, 5):
        sac, reader, batch = sampled(span=(burn_in, 1, 1))
        true = reader.online(sac.network.encoder, batch)[0].detach()
        rows = batch.sequences
        rows[HIDDEN] += 0.5 * rows[HIDDEN].any(-1, keepdim=True)  # zero at the start of episodes
        found = reader.online(sac.network.encoder, batch)[0].detach()
        errors[burn_in] = float((found - true)[batch.counted].abs().mean())
    assert errors[5] < 0.3 * errors[0]


def test_gradients_flow_through_learnt_steps_and_not_through_the_burn_in():
    sac, reader, batch = sampled()
    rows = batch.sequences
    audio = rows["agents", "observation", "audio"].requires_grad_()
    before, after = reader.online(sac.network.encoder, batch)
    assert not after.requires_grad
    window = int(rows[VALID].all(1).nonzero()[0])
    before.unflatten(0, (-1, 4))[window, 2].sum().backward()
    reached = audio.grad[window].flatten(1).abs().sum(1) > 0.0
    assert reached.nonzero().flatten().tolist() == [3, 4, 5]


def test_targets_unroll_the_averaged_parameters():
    """The memory of the target network has parameters of its own."""
    sac, reader, batch = sampled()
    with torch.no_grad():
        for parameter in sac.loss.target.parameters():
            parameter.zero_()  # all gates are 0.5 and candidates are 0
        after = reader.after(sac.loss.target.encoder, batch)
    _, online = reader.online(sac.loss.critic.encoder, batch)
    assert online.abs().max() > 0.05
    assert after.abs().max() < online.abs().max() / 4


@pytest.mark.parametrize(
    "changes",
    [
        {"random_shift": 2, "encoder_gradient": EncoderGradient.critic, "steps": 3},
        {
            "targets": Targets.same,
            "critic": ActionValuesCfg(hidden=[8], normalisation=Normalisation.batch_renorm),
        },
        {"network": replace(GRU, critic=Critic.central, parameters=Parameters.separate)},
    ],
    ids=["sac_fast", "crossq", "central"],
)
def test_every_option_of_sac_learns_from_sequences(changes):
    torch.manual_seed(0)
    env = partial(make_fake_env, horizon=6, agents=2, hybrid=True)
    few = {"network": GRU, "replay": ReplayCfg(1000, 64), "updates_per_frame": 0.02}
    numbers = NUMBERS | few | changes
    sac = SAC("agents", team_specs(env(1, 0))["agents"], SACCfg(**numbers), CPU)
    memory = {name: p.clone() for name, p in sac.network.named_parameters() if ".gru." in name}
    with torch.no_grad():
        batch = with_memory(env(4, 0), sac.explorer).rollout(32, sac.explorer, **WHOLE)
    sac.learn(batch)
    assert all(math.isfinite(number) for number in sac.update().values())
    learnt = dict(sac.network.named_parameters())
    assert memory
    assert all((learnt[name] != before).any() for name, before in memory.items())


def trained_return(memory, batches):
    torch.manual_seed(0)
    network = replace(GRU, trunk_features=16, memory=memory)
    spec = team_specs(make_cue(1, 0))["agents"]
    sac = SAC("agents", spec, SACCfg(network=network, **NUMBERS), CPU)
    experience = Experience(make_cue, sac.explorer, CollectCfg(1, worlds=16, steps=16, processes=0))
    experience.restart(0)
    for _ in range(batches):
        sac.learn(experience.collect())
        experience.update_policy()
    experience.close()
    scores = evaluate(make_cue(16, 0), sac.actor, 32, 1, Exploration.deterministic)
    return scores["agents"].returns.mean()


@pytest.mark.slow
def test_a_task_that_needs_memory_is_learnt_with_a_gru_and_not_without():
    assert trained_return(Memory.gru, 4) > 0.9
    assert abs(trained_return(Memory.none, 4)) < 0.3


def test_a_restored_buffer_has_the_hidden_states():
    sac, _, _ = sampled()
    sac.replay.cfg = replace(sac.replay.cfg, in_checkpoint=True)
    other, _, _ = sampled()
    other.replay.load_state_dict(sac.replay.state_dict())
    drawn = []
    for each in (sac, other):
        torch.manual_seed(5)
        drawn.append(each.replay.sample(8).sequences)
    assert drawn[0][HIDDEN].any()
    assert (drawn[0] == drawn[1]).all()


def test_hidden_states_count_as_stored_bytes():
    sac, _, _ = sampled()
    without = storage_needed(team_specs(make_env(1, 0))["agents"], sac.cfg.replay)
    assert sac.storage_needed.memory_bytes - without.memory_bytes == 4000 * 2 * 16 * 4


@pytest.mark.parametrize(
    ("numbers", "parts"),
    [
        ({"burn_in": -1}, ("algo.burn_in", "-1")),
        ({"sequence_steps": 0}, ("algo.sequence_steps", " 0")),
        ({"sequence_steps": 24}, ("sequence_steps=24", "algo.batch_size", "64")),
    ],
)
def test_sequences_that_do_not_fit_an_update_are_refused(numbers, parts):
    with pytest.raises(ValueError, match=naming(*parts)):
        SACCfg(network=GRU, **numbers)


def test_a_batch_without_sequences_is_refused():
    sac, reader, batch = sampled()
    with pytest.raises(ValueError, match=naming("sequences")):
        reader.after(sac.network.encoder, replace(batch, sequences=None))
    assert isinstance(batch.sequences, TensorDict)
