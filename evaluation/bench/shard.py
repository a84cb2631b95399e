"""A run's share for one of several machines that know nothing of each other."""

import re
from collections.abc import Sequence
from typing import Self, TypeVar

from pydantic import Field, model_validator

from contracts.base import Wire

T = TypeVar("T")
MAX_SHARDS = 10_000
_WRITTEN = re.compile(r"(\d{1,9})/(\d{1,9})")


class Shard(Wire):
    """The `number`th of `of` shares, counted from 1."""

    number: int
    of: int = Field(ge=1, le=MAX_SHARDS)

    @model_validator(mode="after")
    def _is_one_of_them(self) -> Self:
        if not 1 <= self.number <= self.of:
            raise ValueError(
                f"there is no shard {self}: of {self.of} the first is 1/{self.of} and the last {self.of}/{self.of} "
                "(add 1 to an index that counts from 0)"
            )
        return self

    @classmethod
    def parse(cls, text: str) -> Self:
        """From `i/n`. Raises ValueError, which pydantic.ValidationError is."""
        found = _WRITTEN.fullmatch(text)
        if found is None:
            raise ValueError(f"{text!r} is no shard; write i/n, such as 2/8 for the second of eight")
        return cls(number=int(found[1]), of=int(found[2]))

    def __str__(self) -> str:
        return f"{self.number}/{self.of}"

    def share(self, items: Sequence[T]) -> list[T]:
        """Every `of`th item, so that each share has its part of whatever the whole is ordered by."""
        return list(items[self.number - 1 :: self.of])
