"""Numbers of examples: some in the tests, many where `tools.soak` asks for them."""

import os

from hypothesis import HealthCheck, settings

EXAMPLES = int(os.environ.get("PARSER_EXAMPLES", "25"))

settings.register_profile(
    "parsers",
    max_examples=EXAMPLES,
    deadline=None,  # the machine may be busy
    derandomize="PARSER_EXAMPLES" not in os.environ,  # the tests try the same ones each day
    database=None,
    suppress_health_check=list(HealthCheck),
)
