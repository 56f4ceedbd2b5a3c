"""What the message of an error has to name, whatever its wording."""

import re


def naming(*parts):
    """Return a pattern for `pytest.raises(..., match=...)`: a message of one line with all parts.

    Args:
        *parts: What the reader needs, in any order: the field, its value, the choices, a file.
    """
    return "^" + "".join(rf"(?=.*{re.escape(str(part))})" for part in parts) + r".*\Z"
