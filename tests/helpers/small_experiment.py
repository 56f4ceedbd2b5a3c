"""Runs of a small experiment on disk: three arms, three seeds, 200 frames."""

from stored_runs import write_run

from veca_marl.reports.gather import run_folder

EXPERIMENT = ["+experiment=audio_ablation", "experiment.seeds=[0,1,2]", "total_frames=200"]
# without the numbers of frames that these arms have in the file
EXPERIMENT += [f"experiment.arms.{name}=['senses/audio={name}']" for name in ("stereo", "mono")]
# without the claim about speed: all arms have two evaluations
EXPERIMENT += [
    "experiment.claims=['hrtf > stereo','hrtf > mono','stereo > mono','hrtf > random']",
]
RETURNS = {"hrtf": (6.0, 6.5, 7.0), "stereo": (5.0, 5.5, 6.0), "mono": (0.0, 0.5, 0.2)}


def write_all(runs, arms, leave_out=()):
    for arm, returns in RETURNS.items():
        for seed, final in enumerate(returns):
            if (arm, seed) not in leave_out:
                config = {**arms[arm], "seed": seed}
                points = [(100, final / 2), (200, final)]
                write_run(run_folder(runs, arm, seed), config, points)
