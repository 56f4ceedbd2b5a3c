"""The overrides of an arm of an experiment, and those of a command."""

import pytest

from veca_marl.config import ConfigError, compose
from veca_marl.config.experiment import check_contradictions

ARM = ["+experiment=audio_ablation", "experiment.arm=mono"]


def test_an_arm_without_its_overrides_is_refused():
    with pytest.raises(ConfigError) as error:
        compose(ARM)
    assert str(error.value).startswith("experiment.arm=mono is a run without senses/audio=mono, ")
    assert "train -m +experiment=audio_ablation experiment.arm=mono" in str(error.value)


def test_an_arm_with_its_overrides_is_composed():
    own = ["senses/audio=mono", "total_frames=245_760"]
    assert compose([*ARM, *own]).experiment.arm == "mono"


def test_an_unknown_arm_is_refused_by_the_choices():
    with pytest.raises(ConfigError, match=r"arm=deaf: no such arm; choices: hrtf, stereo, mono"):
        compose([ARM[0], "experiment.arm=deaf"])


def test_an_override_that_an_arm_would_replace_is_refused():
    own = ["algo=sac", "total_frames=100"]
    check_contradictions("a", own, ["+task=KickTheBall", "total_frames=100", "algo.gamma=0.9"])
    with pytest.raises(ConfigError, match=r"algo=ppo: arm a sets algo=sac; give .*arms.a=\[...\]"):
        check_contradictions("a", own, ["algo=ppo"])
