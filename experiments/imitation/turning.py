"""Print how a policy of ObjectNav turns, with its most likely and with sampled actions.

    python experiments/imitation/turning.py RUN

Eight worlds are played for 500 steps. Printed are the mean magnitude of the turning action and the
fraction of the steps in which its sign differs from that of the step before.
"""

import sys
from contextlib import closing

import torch
from tensordict.nn import TensorDictSequential
from torchrl.envs import ExplorationType, set_exploration_type

from veca_marl.envs.adapters.torchrl.env import VecaEnv
from veca_marl.evaluate import EvaluateOptions, stored_actors, stored_configuration, team_specs

WORLDS, STEPS, SEED, TURN = 8, 500, 1234, 1  # TURN: component of a walker's action


def main(run: str) -> None:
    """Play the policy of a run and print the figures."""
    checkpoint = EvaluateOptions(run=run).path()
    cfg = stored_configuration(checkpoint, [], "run=")
    with closing(VecaEnv(cfg.game, WORLDS, SEED)) as env:
        actors = stored_actors(cfg, checkpoint, team_specs(env))
        policy = TensorDictSequential(*actors.values())
        for kind in (ExplorationType.DETERMINISTIC, ExplorationType.RANDOM):
            env.set_seed(SEED)
            torch.manual_seed(SEED)
            with torch.no_grad(), set_exploration_type(kind):
                played = env.rollout(STEPS, policy, break_when_any_done=False)
            turn = played["agents", "action"][..., 0, TURN]
            changes = (turn[:, 1:].sign() != turn[:, :-1].sign()).float().mean()
            print(f"{kind}: magnitude {turn.abs().mean():.2f}, changes of sign {changes:.2f}")


if __name__ == "__main__":
    main(sys.argv[1])
