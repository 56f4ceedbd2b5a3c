"""`python -m veca_marl.babybench`: scores of SelfTouch and HandRegard."""

import json

import pytest
from refusals import naming

import veca_marl
from veca_marl.babybench import Result, lines, main


def test_the_suite_is_not_among_the_tasks_of_the_paper():
    assert veca_marl.list_tasks(suite="babybench") == ["HandRegard", "SelfTouch"]
    assert not {"HandRegard", "SelfTouch"} & set(veca_marl.list_tasks())
    with pytest.raises(ValueError, match=naming("atari", "babybench", "veca")):
        veca_marl.list_tasks(suite="atari")


def test_the_score_is_the_share_of_regions_touched_by_both_hands():
    result = Result("SelfTouch", "expert", 1000)
    for left, right in (({"chest", "head"}, {"chest"}), ({"chest"}, set())):
        result.add({"left_hand": len(left) / 14, "right_hand": len(right) / 14})
        result.add_touched({"left_hand": left, "right_hand": right})
    assert result.scores == pytest.approx([3 / 28, 1 / 28])
    assert result.union_score == pytest.approx(3 / 28)
    assert result.touched["left_hand"]["chest"] == 2
    assert any("chest 2" in line for line in lines(result))
    assert not any("BabyBench" in line for line in lines(result))


def test_episodes_are_played_and_written(tmp_path, capsys):
    file = tmp_path / "scores.json"
    words = ["+task=HandRegard", "task.max_seconds=0.2", "senses/vision=blind", "policy=random"]
    assert main([*words, "episodes=2", f"json={file}"]) == 0
    content = json.loads(file.read_text())
    assert len(content["scores"]) == 2
    assert len(content["parts"]) == 4
    printed = capsys.readouterr().out
    assert "HandRegard, policy random, 2 episodes of 5 steps" in printed
    assert "not comparable with BabyBench, whose episodes have 1000 steps" in printed


def test_another_task_is_refused(capsys):
    assert main(["+task=KickTheBall"]) == 2
    error = capsys.readouterr().err
    assert all(name in error for name in ("KickTheBall", "SelfTouch", "HandRegard"))


def test_a_game_without_senses_is_refused_in_one_line(capsys):
    words = ["+task=SelfTouch", "senses/touch=numb", "senses/proprioception=none", "episodes=1"]
    assert main(words) == 2
    error = capsys.readouterr().err
    assert all(name in error for name in ("sense", "touch", "proprioception"))
    assert error.count("\n") == 1
