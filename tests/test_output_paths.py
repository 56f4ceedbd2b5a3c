"""Places that cannot be written to are refused before a command starts to work."""

import pytest
from refusals import naming

from tools.experts_table.command import main as experts_table
from veca_marl.babybench import main as babybench
from veca_marl.config import ConfigError
from veca_marl.config.command_line import check_file, check_folder
from veca_marl.override_text import quoted
from veca_marl.report import main as report

FILE = quoted(__file__)


def test_new_places_are_accepted(tmp_path):
    assert check_file(tmp_path / "new" / "scores.json", "json") == tmp_path / "new" / "scores.json"
    assert check_folder(tmp_path / "new" / "table", "to") == tmp_path / "new" / "table"
    assert not (tmp_path / "new").exists()


def test_impossible_places_are_named(tmp_path):
    file = tmp_path / "file"
    file.touch()
    with pytest.raises(ConfigError, match=naming(f"json={tmp_path}", "file")):
        check_file(tmp_path, "json")
    with pytest.raises(ConfigError, match=naming(f"to={file}", "folder")):
        check_folder(file, "to")
    with pytest.raises(ConfigError, match=naming(f"json={file / 'scores.json'}", f" {file} ")):
        check_file(file / "scores.json", "json")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("command", "arguments", "place"),
    [
        (babybench, ["+task=SelfTouch", "json=."], "json=."),
        (experts_table, ["tasks=[KickTheBall]", f"to={FILE}"], f"to={__file__}"),
        (report, ["+experiment=audio_ablation", f"to={FILE}"], f"to={__file__}"),
        (report, ["+experiment=audio_ablation", "results=no.csv"], "results=no.csv"),
    ],
)
def test_commands_refuse_them(command, arguments, place, capsys):
    assert command(arguments) == 2
    assert place in capsys.readouterr().err
