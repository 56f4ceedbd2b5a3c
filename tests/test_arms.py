"""The overrides of an arm of an experiment, and those of a command."""

import pytest
from refusals import naming

from veca_marl.config import ConfigError, compose
from veca_marl.config.experiment import check_contradictions

ARM = ["+experiment=audio_ablation", "experiment.arm=mono"]


def test_an_arm_without_its_overrides_is_refused():
    command = "train -m +experiment=audio_ablation experiment.arm=mono"
    with pytest.raises(ConfigError, match=naming("senses/audio=mono", command)):
        compose(ARM)


def test_an_arm_with_its_overrides_is_composed():
    own = ["senses/audio=mono", "total_frames=409_600"]
    assert compose([*ARM, *own]).experiment.arm == "mono"


def test_an_unknown_arm_is_refused_by_the_choices():
    with pytest.raises(ConfigError, match=naming("arm=deaf", "hrtf", "stereo", "mono")):
        compose([ARM[0], "experiment.arm=deaf"])


def test_an_override_that_an_arm_would_replace_is_refused():
    own = ["algo=sac", "total_frames=100"]
    check_contradictions("a", own, ["+task=KickTheBall", "total_frames=100", "algo.gamma=0.9"])
    with pytest.raises(ConfigError, match=naming("algo=ppo", "algo=sac", "arms.a=[...]")):
        check_contradictions("a", own, ["algo=ppo"])
