"""What the code of a text prints and draws, written behind it."""

import re
import textwrap
from collections.abc import Mapping
from pathlib import Path
from typing import Any

SHOWN = Path(__file__).parent / "shown.json"  # text and pictures of each piece of code, by the code
BLOCK = re.compile(r"^([ \t]*)```python\n(.*?)^\1```$", re.MULTILINE | re.DOTALL)
_PRINTED = re.compile(r"\s*(\w+\s*)?```text")  # by hand, for readers of the text


def with_shown(text: str, shown: Mapping[str, dict[str, Any]]) -> str:
    """The text with what its code prints and draws behind each block, as far as that is known."""

    def added(match: re.Match[str]) -> str:
        indent, code = match.groups()
        found = shown.get(textwrap.dedent(code), {})
        by_hand = _PRINTED.match(text, match.end())
        parts = [f"```text\n{found['text']}\n```"] if found.get("text") and not by_hand else []
        parts += [f"![What this draws]({picture})" for picture in found.get("pictures", [])]
        return match.group() + "".join("\n\n" + textwrap.indent(part, indent) for part in parts)

    return BLOCK.sub(added, text)
