"""The policy as a constrained PDDLStream domain."""

from typing import Literal

Encoding = Literal["check", "local", "order"]
"""How the policy constrains the actions: see `gentamp_lp.constrained.encodings`."""
