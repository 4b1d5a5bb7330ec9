"""The request in docs/reference/search.md is one that robots serve."""

from __future__ import annotations

import re
from pathlib import Path

from fluentboard.model.yaml_format import read_fluents
from fluentboard_modules.search.config import SearchConfig
from fluentboard_modules.search.request import read_request

PAGE = Path(__file__).parents[2] / "docs" / "reference" / "search.md"


def test_the_request_in_the_documentation_is_served() -> None:
    (text,) = re.findall(r"```yaml\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    by_name = {fluent.name: fluent for fluent in read_fluents(text)}
    request = read_request(by_name["findTheMill"], by_name, SearchConfig())
    assert (request.target_class, request.source) == ("PepperMill", "user")
    assert [probability for _, _, probability in request.volumes] == [0.4]
    assert request.config.time_budget_s == 120.0
