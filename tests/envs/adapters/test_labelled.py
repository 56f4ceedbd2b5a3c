"""`LabelledEnv`: what the expert would do, beside what everything else observes."""

import pytest
import torch
from composed import compose
from torchrl.envs import check_env_specs
from torchrl.envs.utils import step_mdp

from veca_marl.envs.adapters.torchrl.env import VecaEnv
from veca_marl.envs.adapters.torchrl.labelled import LABEL, LabelledEnv
from veca_marl.envs.adapters.torchrl.scripted import ExpertPolicy
from veca_marl.envs.core.game import from_parts
from veca_marl.envs.experts.control.crawl_gait import CrawlGait
from veca_marl.envs.experts.motor_skills import CrawlBabyExpert

SHORT = "task.max_seconds=0.4"
GAMES = {
    "vector": ["+task=KickTheBall", "senses/vision=blind", SHORT],
    "parts": ["+task=KickTheBall", "body=walker_voice", "senses/vision=blind", SHORT],
    "choice": ["+task=KickTheBall", "body=walker_discrete", "senses/vision=blind", SHORT],
    "teams": ["+task=PushOut1v1", "body=walker", "senses/vision=blind", SHORT],
}


@pytest.fixture(params=GAMES)
def game(request):
    return compose(GAMES[request.param]).game


def labels(state, env):
    return {team: state[team, LABEL] for team in env.group_map}


def same(one, other):
    if isinstance(one, torch.Tensor):
        return torch.equal(one, other)
    return all(torch.equal(one[part], other[part]) for part in one.keys())  # noqa: SIM118


def test_the_label_is_what_the_expert_does(game):
    """While the expert acts, in two worlds, over the end of an episode."""
    env = LabelledEnv(game, 2, 3, teams=list(VecaEnv(game, 1).group_map))
    plain = VecaEnv(game, 2, 3)
    policy, state, other = ExpertPolicy(plain), env.reset(), plain.reset()
    for _ in range(8):
        acted = policy(other)
        for team, label in labels(state, env).items():
            assert same(label, acted[team, "action"])
            state[team, "action"] = label
        state, other = step_mdp(env.step(state)), step_mdp(plain.step(acted))
    env.close()
    plain.close()


def test_everything_else_has_the_same_bytes(game):
    team, *others = VecaEnv(game, 1).group_map
    env, plain = LabelledEnv(game, 1, 5, teams=[team]), VecaEnv(game, 1, 5)
    torch.manual_seed(0)
    found = env.rollout(15, break_when_any_done=False)
    torch.manual_seed(0)
    wanted = plain.rollout(15, break_when_any_done=False)
    assert (team, LABEL) not in env.observation_keys
    assert all(LABEL not in found[other].keys() for other in others)  # noqa: SIM118
    for key, value in wanted.items(True, True):
        assert torch.equal(value, found[key]), key
    env.close()
    plain.close()


def test_specs_hold(game):
    env = LabelledEnv(game, 2, 0, teams=list(VecaEnv(game, 1).group_map))
    check_env_specs(env, break_when_any_done="both")
    env.close()


def test_a_team_needs_an_expert_that_can_play_it():
    deaf = compose(["+task=KickTheBall", "senses/audio=deaf"]).game
    with pytest.raises(ValueError, match="audio"):
        LabelledEnv(deaf, 1, 0, teams=["agents"])


CRAWL = ["+task=CrawlBaby", "senses/vision=blind", "senses/audio=deaf", "senses/touch=numb"]


def test_the_expert_follows_the_body_only_where_an_action_was_not_its_label(monkeypatch):
    asked = []
    monkeypatch.setattr(CrawlBabyExpert, "follow_body", lambda expert: asked.append(expert.task))
    env = LabelledEnv(compose(CRAWL).game, 3, 0, teams=["agents"])
    tasks, state = [game.task for game in env.games], env.reset()
    for others in ([], [1], [], [0, 2]):
        state["agents", "action"] = state["agents", LABEL].clone()
        state["agents", "action"][others, 0, 3] *= 0.5
        asked.clear()
        state = step_mdp(env.step(state))
        assert asked == [tasks[world] for world in others]
    asked.clear()
    state["agents", "action"] = env.reset()["agents", LABEL]
    env.step(state)
    assert asked == []
    env.close()


def test_labels_of_a_gait_are_those_of_the_phase_at_which_the_body_is():
    """The body is moved by the same gait half a stride ahead of the clock of the expert."""
    env = LabelledEnv(compose(CRAWL).game, 1, 0, teams=["agents"])
    state, (game,) = env.reset(), env.games
    gait = CrawlGait(game.task.body, game.world.clock.step_s)
    for _ in range(7):  # a stride takes 13.8 steps
        gait.command()
    pairs = []
    for _ in range(100):
        action = from_parts(game.task.body.encode(gait.command()))
        state["agents", "action"] = torch.tensor(action, dtype=torch.float32).view(1, 1, -1)
        pairs.append((state["agents", "action"], state["agents", LABEL]))
        state = step_mdp(env.step(state))
    env.close()
    acted, labelled = (torch.stack(each[40:]).ravel() for each in zip(*pairs, strict=True))
    assert torch.corrcoef(torch.stack([acted, labelled]))[0, 1] > 0.5
