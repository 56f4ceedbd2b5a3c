"""Print how fast a policy of CrawlBaby, and the expert, crawl, and how well they keep the heading.

    python experiments/imitation/crawling.py RUN

Eight worlds are played for 199 steps. Printed are the mean speeds of the pelvis along the heading
of the trunk and along that at the start, and the mean angle between the two headings.
"""

import sys
from contextlib import closing

import numpy as np
import torch
from tensordict.nn import TensorDictSequential
from torchrl.envs import ExplorationType, set_exploration_type
from torchrl.envs.utils import step_mdp

from veca_marl.envs.adapters.torchrl.env import VecaEnv
from veca_marl.envs.adapters.torchrl.scripted import ExpertPolicy
from veca_marl.evaluate import EvaluateOptions, stored_actors, stored_configuration, team_specs

WORLDS, STEPS, SEED = 8, 199, 5


def bodies(env: VecaEnv) -> tuple[np.ndarray, np.ndarray]:
    """Return positions and headings on the floor, ``(worlds, 2)`` each."""
    found = [game.task.body for game in env.games]
    headings = np.array([body.forward[:2] / np.linalg.norm(body.forward[:2]) for body in found])
    return np.array([body.position[:2] for body in found]), headings


def show(name: str, env: VecaEnv, policy: torch.nn.Module) -> None:
    """Play a policy and print the figures."""
    state = env.reset()
    (before, start), step_s = bodies(env), env.games[0].world.clock.step_s
    rows = []
    for _ in range(STEPS):
        with torch.no_grad(), set_exploration_type(ExplorationType.DETERMINISTIC):
            state = step_mdp(env.step(policy(state)))
        now, heading = bodies(env)
        speed, before = (now - before) / step_s, now
        cosine = np.clip((heading * start).sum(1), -1.0, 1.0)
        along = [(speed * one).sum(1).mean() for one in (heading, start)]
        rows.append([*along, np.degrees(np.arccos(cosine)).mean()])
    own, first, angle = np.mean(rows, axis=0)
    print(f"{name}: {own:.2f} m/s ahead, {first:.2f} m/s along the start, {angle:.0f} degrees off")


def main(run: str) -> None:
    """Play the policy of a run, and the expert."""
    checkpoint = EvaluateOptions(run=run).path()
    cfg = stored_configuration(checkpoint, [], "run=")
    with closing(VecaEnv(cfg.game, WORLDS, SEED)) as env:
        actors = stored_actors(cfg, checkpoint, team_specs(env))
        show("policy", env, TensorDictSequential(*actors.values()))
        env.set_seed(SEED)
        show("expert", env, ExpertPolicy(env))


if __name__ == "__main__":
    main(sys.argv[1])
