# SPDX-License-Identifier: BSD-3-Clause
"""Makes logs that no recorder writes, with the official reader and writer."""

import struct
import zlib
from collections.abc import Callable, Mapping
from pathlib import Path

from mcap.reader import make_reader
from mcap.writer import Writer


def copy_changed(
    log: Path,
    target: Path,
    texts: Mapping[str, str],
    change: Callable[[str, bytes], bytes] = lambda _, data: data,
) -> None:
    """Copies a log with other texts in its metadata ("RECORD/ENTRY"), and other messages.

    `change` gets the topic and the data of each message. All checksums are right.
    """
    with log.open("rb") as source, target.open("wb") as file:
        reader = make_reader(source)
        writer = Writer(file)
        header = reader.get_header()
        writer.start(header.profile, header.library)
        summary = reader.get_summary()
        assert summary is not None
        for metadata in reader.iter_metadata():
            entries = {
                key: texts.get(f"{metadata.name}/{key}", value)
                for key, value in metadata.metadata.items()
                if key != "crc32"
            }
            entries["crc32"] = checksum(metadata.name, entries)
            writer.add_metadata(metadata.name, entries)
        for one in reader.iter_attachments():
            writer.add_attachment(one.create_time, one.log_time, one.name, one.media_type, one.data)
        schemas = {
            number: writer.register_schema(one.name, one.encoding, one.data)
            for number, one in summary.schemas.items()
        }
        channels = {
            number: writer.register_channel(
                one.topic, one.message_encoding, schemas[one.schema_id], one.metadata
            )
            for number, one in summary.channels.items()
        }
        for _, channel, message in reader.iter_messages():
            writer.add_message(
                channels[channel.id],
                message.log_time,
                change(channel.topic, message.data),
                message.publish_time,
                message.sequence,
            )
        writer.finish()


def checksum(name: str, entries: Mapping[str, str]) -> str:
    """The checksum of a record of metadata, as docs/log_format.md says."""
    texts = [one.encode() for pair in sorted(entries.items()) for one in pair]
    content = [name.encode(), *texts]
    return f"{zlib.crc32(b''.join(struct.pack('<I', len(one)) + one for one in content)):08x}"
