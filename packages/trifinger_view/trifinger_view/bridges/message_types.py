# SPDX-License-Identifier: BSD-3-Clause
"""Types of ROS 2's messages, read from their definitions: names and hashes.

A definition ("ros2msg") is the text of a .msg file, followed by those of the types that it uses.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from trifinger.errors import InvalidArgument

SCALARS = {
    "int8": 2,
    "uint8": 3,
    "char": 3,
    "int16": 4,
    "uint16": 5,
    "int32": 6,
    "uint32": 7,
    "int64": 8,
    "uint64": 9,
    "float32": 10,
    "float64": 11,
    "bool": 15,
    "byte": 16,
    "string": 17,
}
"""Numbers that descriptions of types (REP 2016) give to types."""
NESTED = 1
ARRAY = 48
UNBOUNDED = 144

SEPARATOR = re.compile(r"^=+\nMSG: (\S+)\n", re.MULTILINE)
FIELD = re.compile(r"(?P<type>[\w/]+)(?P<array>\[(?P<size>\d*)\])?\s+(?P<name>\w+)")
CONSTANT = re.compile(r"[\w/]+\s+\w+\s*=")


@dataclass(frozen=True)
class Field:
    """A field of a message."""

    name: str
    type: str
    """A scalar's name, or the full name of a message's type."""
    size: int | None = None
    """Number of elements; 0: any number; None: the field is no array."""

    @property
    def is_nested(self) -> bool:
        """True if the field is a message, or an array of messages."""
        return self.type not in SCALARS


@dataclass(frozen=True)
class MessageType:
    """A type of message, with the types that it uses."""

    name: str
    """For example "sensor_msgs/msg/JointState"."""
    types: Mapping[str, tuple[Field, ...]]
    """Fields of this type and of all that it uses, by name."""

    @property
    def fields(self) -> tuple[Field, ...]:
        """The fields of this type."""
        return self.types[self.name]

    def part(self, name: str) -> MessageType:
        """A type that this one uses."""
        return MessageType(name, self.types)

    @property
    def used(self) -> list[str]:
        """Names of the types that this one uses, and of those that they use, sorted."""

        def names(of: str) -> Iterator[str]:
            for field in self.types[of]:
                if field.is_nested:
                    yield field.type
                    yield from names(field.type)

        return sorted(set(names(self.name)))

    @property
    def hash(self) -> str:
        """The hash by which programs of ROS 2 compare types, "RIHS01_..." (REP 2016)."""
        description = {
            "type_description": self._description(self.name),
            "referenced_type_descriptions": [self._description(name) for name in self.used],
        }
        text = json.dumps(description, ensure_ascii=True, separators=(", ", ": "))
        return f"RIHS01_{hashlib.sha256(text.encode()).hexdigest()}"

    def _description(self, name: str) -> dict[str, object]:
        return {
            "type_name": name,
            "fields": [
                {
                    "name": field.name,
                    "type": {
                        "type_id": type_id(field),
                        "capacity": field.size or 0,
                        "string_capacity": 0,
                        "nested_type_name": field.type if field.is_nested else "",
                    },
                }
                for field in self.types[name]
            ],
        }


def type_id(field: Field) -> int:
    """The number of a field's type in a description."""
    number = SCALARS.get(field.type, NESTED)
    if field.size is None:
        return number
    return number + (ARRAY if field.size else UNBOUNDED)


def dds_name(name: str) -> str:
    """The name of a type in DDS: "sensor_msgs::msg::dds_::JointState_"."""
    package, kind, short = name.split("/")
    return f"{package}::{kind}::dds_::{short}_"


def parse(name: str, definition: str) -> MessageType:
    """Reads a definition; raises InvalidArgument for a line that is not understood."""
    first, *rest = SEPARATOR.split(definition)
    texts = {name: first}
    for used, text in zip(rest[::2], rest[1::2], strict=True):
        texts[full_name(used)] = text
    types = {each: tuple(fields(each, text)) for each, text in texts.items()}
    for each in types.values():
        for field in each:
            if field.is_nested and field.type not in types:
                raise InvalidArgument(f"the definition of {name} lacks the type {field.type}")
    return MessageType(name, types)


def fields(name: str, text: str) -> Iterator[Field]:
    """The fields of the type `name` in the text of its file."""
    package = name.split("/")[0]
    for line in text.splitlines():
        words = line.partition("#")[0].strip()
        if not words or CONSTANT.match(words):
            continue
        found = FIELD.fullmatch(words)
        if found is None:
            raise InvalidArgument(f"a line of {name} is not understood: {words}")
        kind = found["type"]
        if kind not in SCALARS:
            kind = full_name(kind if "/" in kind else f"{package}/{kind}")
        size = None if found["array"] is None else int(found["size"] or 0)
        yield Field(found["name"], kind, size)


def full_name(name: str) -> str:
    """ "std_msgs/Header" as "std_msgs/msg/Header"."""
    package, _, rest = name.partition("/")
    return f"{package}/{rest if rest.startswith('msg/') else f'msg/{rest}'}"
