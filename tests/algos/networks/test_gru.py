"""The gated recurrent unit of a team compared with formulas written by hand."""

import pytest
import torch
from torchrl.modules import set_recurrent_mode

from veca_marl.algos.networks.memory import GatedMemory

ROWS, TIME, AGENTS, INPUTS, SIZE = 3, 7, 2, 5, 4


@pytest.fixture
def memory():
    torch.manual_seed(0)
    made = GatedMemory(INPUTS, SIZE)
    with torch.no_grad():  # biases are zero at the start
        for parameter in made.parameters():
            parameter.add_(0.3 * torch.randn_like(parameter))
    return made


@pytest.fixture
def window():
    """Features, states, starts of episodes and presence of agents, with some of each kind."""
    torch.manual_seed(1)
    begins = torch.zeros(ROWS, TIME, 1, 1, dtype=torch.bool)
    begins[0, 0] = begins[1, 3] = begins[2, 6] = True
    present = torch.ones(ROWS, TIME, AGENTS, 1, dtype=torch.bool)
    present[0, 2:4, 1] = present[2, 4:, 0] = False
    features = torch.randn(ROWS, TIME, AGENTS, INPUTS, requires_grad=True)
    states = torch.randn(ROWS, TIME, AGENTS, SIZE)
    states[0, 4, 1] = 0.0  # as stored after an elimination
    return features, states, begins.expand(-1, -1, AGENTS, 1), present


def cell(weights, x, h):
    """One step of Cho et al. 2014 as the documentation of `torch.nn.GRU` states it."""
    w_in, w_state, b_in, b_state = weights
    of_input, of_state = (x @ w_in.T + b_in).chunk(3), (h @ w_state.T + b_state).chunk(3)
    r = torch.sigmoid(of_input[0] + of_state[0])
    z = torch.sigmoid(of_input[1] + of_state[1])
    n = torch.tanh(of_input[2] + r * of_state[2])
    return (1.0 - z) * n + z * h


def unrolled(memory, features, states, begins, present):
    """Each agent of each row by itself, one step after another."""
    weights = list(memory.parameters())
    out = []
    for row in range(ROWS):
        for agent in range(AGENTS):
            h = states[row, 0, agent]
            for t in range(TIME):
                h = states[row, t, agent] if begins[row, t, agent] else h
                h = cell(weights, features[row, t, agent], h)
                h = h if present[row, t, agent] else torch.zeros(SIZE)
                out.append(h)
    return torch.stack(out).view(ROWS, AGENTS, TIME, SIZE).transpose(1, 2)


def test_sequences_and_their_gradients_equal_a_hand_written_unroll(memory, window):
    results = []
    weights = torch.randn(ROWS, TIME, AGENTS, SIZE)
    for run in (memory, lambda *arrays: unrolled(memory, *arrays)):
        with set_recurrent_mode(True):
            after = run(*window)
        memory.zero_grad()
        window[0].grad = None
        (after * weights).sum().backward()
        results.append([after, window[0].grad, *(p.grad.clone() for p in memory.parameters())])
    for ours, by_hand in zip(*results, strict=True):
        torch.testing.assert_close(ours, by_hand, rtol=1e-4, atol=1e-5)
        assert by_hand.abs().max() > 0.0


def test_single_steps_equal_the_sequence(memory, window):
    features, states, begins, present = window
    with set_recurrent_mode(True):
        sequence = memory(*window)
    state = states[:, 0]
    for t in range(TIME):
        state = torch.where(begins[:, t], states[:, t], state)
        state = memory(features[:, t], state, begins[:, t], present[:, t])
        torch.testing.assert_close(state, sequence[:, t])


def test_no_gradient_crosses_the_start_of_an_episode_or_an_elimination(memory, window):
    with set_recurrent_mode(True):
        after = memory(*window)
    after[1, 4].sum().backward()  # the episode began at step 3
    reached = window[0].grad.abs().sum((2, 3)) > 0.0
    assert reached.nonzero().tolist() == [[1, 3], [1, 4]]
    window[0].grad = None
    with set_recurrent_mode(True):
        memory(*window)[0, 6, 1].sum().backward()  # eliminated in steps 2 and 3
    reached = window[0].grad.abs().sum(3) > 0.0
    assert reached.nonzero().tolist() == [[0, t, 1] for t in (4, 5, 6)]
