"""Enums of messages: a number that this version does not know is a member too, so that a packet is not lost for it."""

from __future__ import annotations

import re
from enum import IntEnum


class OpenEnum(IntEnum):
    """An enum that has a member for every number; those that it does not know are called e.g. ``unknown stage 14``."""

    @classmethod
    def _missing_(cls, value: object) -> OpenEnum | None:
        if not isinstance(value, int):
            return None
        # not among the members: a sender must not make them more
        member = int.__new__(cls, value)
        kind = re.sub(r"(?<!^)(?=[A-Z])", " ", cls.__name__).lower().rpartition(" ")[2]
        member._name_, member._value_ = f"unknown {kind} {value}", value
        return member

    def __str__(self) -> str:
        return self.name

    @property
    def is_known(self) -> bool:
        """Whether this version has a name for it."""
        return self.name in type(self).__members__
