"""What the command makes of its arguments."""

import pytest

from redundax._command._arguments import argument_parser
from redundax._command._run import main


@pytest.mark.parametrize("arguments", [["--png", "a.png", "study", "f.py:p"], ["study", "f.py:p", "--png", "a.png"]])
def test_a_picture_is_asked_for_before_or_after_the_command(arguments):
    assert argument_parser().parse_args(arguments).png.name == "a.png"
    assert argument_parser().parse_args(["study", "f.py:p"]).png is None


def test_an_option_with_two_names_is_told_how_to_give_them(capsys):
    with pytest.raises(SystemExit):
        main(["drive", "arm.xml", "--hold", "A", "B"])
    assert "--hold A --hold B; unrecognized arguments: B" in capsys.readouterr().err
