"""Demonstrations of the toy `FakeEnv`: what a player does that sees the state."""

import torch
from fake_env import FakeEnv
from torchrl.envs.utils import step_mdp

from veca_marl.algos.demonstration_files import Card, Episode, TeamForm
from veca_marl.algos.demonstrations import Demonstrations
from veca_marl.algos.specs import team_specs
from veca_marl.demonstrations.episode_files import Archive, EpisodeWriter
from veca_marl.demonstrations.record import row_arrays, summary


def right_action(env):
    """Return the action of each agent that is rewarded in the present state."""
    state = torch.from_numpy(env.state.copy())
    vector = (state * 1.6 - 0.8).float().unsqueeze(-1).expand(*state.shape, 2).clone()
    if env.hybrid:
        return {"move": vector, "voice": state}
    return state if env.discrete else vector


def forms(env):
    return {t: TeamForm(spec, {"kind": "Toy"}, {}) for t, spec in team_specs(env).items()}


def archive_of(folder, episodes=4, seed=0, **env):
    made = FakeEnv(1, seed, **env)
    card = Card(
        "Toy", seed, episodes, False, 25, forms(made), row_arrays(made), "", {"game": dict(env)}
    )
    archive = Archive(folder, card)
    archive.begin()
    return archive


def play(archive, number, **env):
    """Write an episode, and return it as a rollout."""
    made, played = FakeEnv(1, 0, **env), []
    made.first_world = number
    made.set_seed(0)
    state, done = made.reset(), False
    writer = EpisodeWriter(archive.part(number), row_arrays(made))
    while not done:
        for team in made.group_map:
            state[team, "action"] = right_action(made)
        step = made.step(state)
        writer.add(step)
        own = [(team, name) for team in made.group_map for name in ("observation", "action")]
        played.append(step[0].select(*own, "next").clone())
        done = bool(step["next", "done"])
        state = step_mdp(step)
    returns = dict.fromkeys(made.group_map, float(made.horizon))
    archive.append(Episode(0, writer.steps, writer.end(step["next"]), returns, {}))
    return torch.stack(played)


def record_toy(folder, episodes=4, **env):
    """Record episodes of the toy; return them as rollouts."""
    archive = archive_of(folder, episodes, **env)
    played = [play(archive, number, **env) for number in range(episodes)]
    archive.finish(summary(archive.episodes))
    return played


def demonstrations_of_toy(folder, episodes=4, **env):
    record_toy(folder, episodes, **env)
    return Demonstrations(folder)
