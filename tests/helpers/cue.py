"""A task that needs memory: a cue in the first step of an episode, a reward in the last one.

The cue is one of two sounds. The reward of the last step is 1 for the action that equals the cue,
and -1 otherwise: without memory the return is 0 on average.
"""

from first_seen import ShowOnceEnv


class CueEnv(ShowOnceEnv):
    def _step(self, td):
        out = super()._step(td)
        for team in self.group_map:
            out[team, "reward"] *= out[team, "done"]
        return out


def make_cue(worlds, seed, horizon=4, **options):
    return CueEnv(worlds, seed, horizon=horizon, discrete=True, senses=("audio",), **options)
