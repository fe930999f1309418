# SPDX-License-Identifier: BSD-3-Clause
"""The official package reads our MCAP files, and our reader reads those of the package."""

import io
import itertools
import struct
import subprocess
import tempfile
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import lz4.frame
import pytest
import zstandard
from conftest import BUILD
from hypothesis import given, settings, strategies as st
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.reader import McapReader, NonSeekingReader, SeekingReader
from mcap.stream_reader import StreamReader, breakup_chunk
from mcap.writer import CompressionType, IndexType, Writer

from mcap import records

T = TypeVar("T")
TOOL = BUILD / "tests/python/mcap_tool"
COMPRESSIONS = ("", "lz4", "zstd")
MAGIC = b"\x89MCAP0\r\n"
RECORD_HEADER = struct.Struct("<BQ")


@dataclass(frozen=True)
class Message:
    topic: str
    schema: str
    sequence: int
    log_time: int
    publish_time: int
    data: bytes

    @property
    def definition(self) -> str:
        return f"int32 {self.schema}" if self.schema else ""

    def line(self) -> str:
        words = (
            hex_of(self.topic),
            hex_of(self.schema),
            hex_of(self.definition),
            *(str(number) for number in (self.sequence, self.log_time, self.publish_time)),
            self.data.hex(),
        )
        return "\t".join(("message", *words))


@dataclass(frozen=True)
class Metadata:
    name: str
    entries: tuple[tuple[str, str], ...]

    def line(self) -> str:
        words = (self.name, *itertools.chain.from_iterable(self.entries))
        return "\t".join(("metadata", *(hex_of(word) for word in words)))


@dataclass(frozen=True)
class Attachment:
    log_time: int
    create_time: int
    name: str
    media_type: str
    data: bytes

    def line(self) -> str:
        texts = (hex_of(self.name), hex_of(self.media_type), self.data.hex())
        return "\t".join(("attachment", str(self.log_time), str(self.create_time), *texts))


@dataclass(frozen=True)
class Flush:
    def line(self) -> str:
        return "flush"


Item = Message | Metadata | Attachment | Flush

TIMES = st.integers(0, 2**64 - 1)
TEXTS = st.text(st.characters(exclude_categories=["Cs"]), max_size=8)
# Each topic has one schema, or none.
CHANNELS = st.sampled_from([("/step", "Step"), ("/größe", "Size"), ("/raw", "")])
MESSAGES = st.builds(
    lambda channel, *rest: Message(*channel, *rest),
    CHANNELS,
    st.integers(0, 2**32 - 1),
    TIMES,
    TIMES,
    st.binary(max_size=100),
)
METADATA = st.builds(
    lambda name, entries: Metadata(name, tuple(sorted(entries.items(), key=utf8))),
    TEXTS,
    st.dictionaries(TEXTS.filter(lambda key: key != "crc32"), TEXTS, max_size=3),
)
ATTACHMENTS = st.builds(Attachment, TIMES, TIMES, TEXTS, TEXTS, st.binary(max_size=100))
ITEMS = st.lists(
    st.one_of(MESSAGES, MESSAGES, MESSAGES, METADATA, ATTACHMENTS, st.just(Flush())), max_size=30
)
# The program is started for each example.
FEW = settings(max_examples=25)


def utf8(entry: tuple[str, str]) -> bytes:
    return entry[0].encode()


def hex_of(text: str) -> str:
    return text.encode().hex()


def of_type(kind: type[T], items: Sequence[object]) -> list[T]:
    return [item for item in items if isinstance(item, kind)]


def tool(*arguments: str | Path, lines: Sequence[str] = ()) -> list[str]:
    """Runs the program of ours and returns the lines it prints."""
    done = subprocess.run(
        [TOOL, *arguments],
        input="".join(f"{line}\n" for line in lines),
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()


def write_ours(
    path: Path, items: Sequence[Item], compression: str, chunk_size: int = 1000, finish: bool = True
) -> None:
    lines = [item.line() for item in items]
    tool("write", path, compression, str(chunk_size), lines=lines + ["finish"] * finish)


def read_ours(path: Path, *options: str) -> list[str]:
    """Returns the lines without the last two, which must say that all is well."""
    *lines, count, finish = tool("read", path, *options)
    assert [line for line in lines if line.startswith("damage")] == []
    assert count == f"count\t{sum(line.startswith('message') for line in lines)}"
    assert finish == "finish"
    return lines


def lines_of(items: Sequence[Item]) -> list[str]:
    """Returns what our reader prints of the items: messages, metadata and attachments."""
    kinds = (Message, Metadata, Attachment)
    return [item.line() for kind in kinds for item in of_type(kind, items)]


def write_theirs(path: Path, items: Sequence[Item], **options: object) -> None:
    schemas: dict[str, int] = {"": 0}
    channels: dict[str, int] = {}
    with path.open("wb") as file:
        writer = Writer(file, **options)  # type: ignore[arg-type]
        writer.start("ros2", "theirs")
        for item in items:
            match item:
                case Message():
                    if item.schema not in schemas:
                        data = item.definition.encode()
                        schemas[item.schema] = writer.register_schema(item.schema, "ros2msg", data)
                    if item.topic not in channels:
                        schema = schemas[item.schema]
                        channels[item.topic] = writer.register_channel(item.topic, "cdr", schema)
                    writer.add_message(
                        channels[item.topic],
                        item.log_time,
                        item.data,
                        item.publish_time,
                        item.sequence,
                    )
                case Metadata():
                    writer.add_metadata(item.name, dict(item.entries))
                case Attachment():
                    writer.add_attachment(
                        item.create_time, item.log_time, item.name, item.media_type, item.data
                    )
                case Flush():
                    writer.flush()
        writer.finish()


def messages_of(reader: McapReader) -> list[Message]:
    """Returns the messages in the order of the official reader, chunk by chunk."""
    messages = []
    for schema, channel, message in reader.iter_messages(log_time_order=False):
        assert (channel.schema_id == 0) == (schema is None)
        found = Message(
            channel.topic,
            schema.name if schema else "",
            message.sequence,
            message.log_time,
            message.publish_time,
            message.data,
        )
        if schema:
            assert schema.data == found.definition.encode()
        messages.append(found)
    return messages


def metadata_of(record: records.Metadata) -> Metadata:
    """Takes the checksum out, which must be as docs/log_format.md says."""
    texts = [record.name]
    for key, value in sorted(record.metadata.items(), key=utf8):
        if key != "crc32":
            texts += [key, value]
    data = b"".join(struct.pack("<I", len(text.encode())) + text.encode() for text in texts)
    assert record.metadata["crc32"] == f"{zlib.crc32(data):08x}"
    return Metadata(record.name, tuple(zip(texts[1::2], texts[2::2], strict=True)))


def attachment_of(record: records.Attachment) -> Attachment:
    return Attachment(
        record.log_time, record.create_time, record.name, record.media_type, record.data
    )


def check_index(data: bytes) -> None:
    """Checks the message indexes, the summary and its checksum, byte by byte."""
    footer_offset = len(data) - len(MAGIC) - RECORD_HEADER.size - 20
    start, offset_start, checksum = struct.unpack_from(
        "<QQI", data, footer_offset + RECORD_HEADER.size
    )
    assert zlib.crc32(data[start : len(data) - len(MAGIC) - 4]) == checksum

    summary = SeekingReader(io.BytesIO(data)).get_summary()
    assert summary is not None
    assert summary.statistics is not None
    indexes = {index.chunk_start_offset: index for index in summary.chunk_indexes}
    counts: dict[int, int] = {}
    num_chunks = 0
    for offset, record in records_of(data):
        if not isinstance(record, records.Chunk):
            continue
        num_chunks += 1
        messages = check_chunk(data, record, indexes[offset])
        for message in messages:
            counts[message.channel_id] = counts.get(message.channel_id, 0) + 1
        times = [message.log_time for message in messages]
        assert (record.message_start_time, record.message_end_time) == (min(times), max(times))
    assert num_chunks == len(indexes) == summary.statistics.chunk_count
    assert summary.statistics.channel_message_counts == counts
    assert summary.statistics.message_count == sum(counts.values())
    assert summary.statistics.channel_count == len(summary.channels)
    assert summary.statistics.schema_count == len(summary.schemas)

    groups: dict[int, list[int]] = {}
    offset = start
    while offset < offset_start:
        opcode, length = RECORD_HEADER.unpack_from(data, offset)
        groups.setdefault(opcode, []).append(offset)
        offset += RECORD_HEADER.size + length
        groups[opcode][1:] = [offset]
    found = {}
    while offset < footer_offset:
        opcode, length, group, begin, size = struct.unpack_from("<BQBQQ", data, offset)
        assert opcode == Opcode.SUMMARY_OFFSET
        found[group] = [begin, begin + size]
        offset += RECORD_HEADER.size + length
    assert found == groups


def records_of(data: bytes) -> Iterator[tuple[int, records.McapRecord]]:
    """Yields the records of the data section and where they are."""
    offset = len(MAGIC)
    reader = StreamReader(io.BytesIO(data), emit_chunks=True, validate_crcs=True)
    for record in reader.records:
        yield offset, record
        if isinstance(record, records.DataEnd):
            return
        offset += RECORD_HEADER.size + RECORD_HEADER.unpack_from(data, offset)[1]


def check_chunk(
    data: bytes, chunk: records.Chunk, index: records.ChunkIndex
) -> list[records.Message]:
    """Checks that each message is where the index says, and returns the messages."""
    match chunk.compression:
        case "zstd":
            inside = zstandard.decompress(chunk.data)
        case "lz4":
            inside = lz4.frame.decompress(chunk.data)
        case _:
            inside = chunk.data
    assert len(inside) == chunk.uncompressed_size == index.uncompressed_size
    assert (index.compression, index.compressed_size) == (chunk.compression, len(chunk.data))
    messages = of_type(records.Message, breakup_chunk(chunk, validate_crc=True))
    end = index.chunk_start_offset + index.chunk_length
    positions = sorted(index.message_index_offsets.items(), key=lambda item: item[1])
    num_indexed = 0
    for channel, offset in positions:
        assert offset == end, "the indexes follow the chunk without gaps"
        opcode, length = RECORD_HEADER.unpack_from(data, offset)
        assert opcode == Opcode.MESSAGE_INDEX
        end = offset + RECORD_HEADER.size + length
        entries = records.MessageIndex.read(
            ReadDataStream(io.BytesIO(data[offset + RECORD_HEADER.size : end]))
        )
        assert entries.channel_id == channel
        assert entries.records == sorted(entries.records)
        num_indexed += len(entries.records)
        for time, position in entries.records:
            opcode, _, found_channel, _, found_time = struct.unpack_from("<BQHIQ", inside, position)
            assert (opcode, found_channel, found_time) == (Opcode.MESSAGE, channel, time)
    assert end == index.chunk_start_offset + index.chunk_length + index.message_index_length
    assert num_indexed == len(messages)
    return messages


def check_with_their_readers(path: Path, items: Sequence[Item]) -> None:
    messages = of_type(Message, items)
    data = path.read_bytes()
    for reader in (
        NonSeekingReader(io.BytesIO(data), validate_crcs=True),
        SeekingReader(io.BytesIO(data), validate_crcs=True),
    ):
        found = messages_of(reader)
        assert sorted(found, key=repr) == sorted(messages, key=repr)
    stream = StreamReader(io.BytesIO(data), validate_crcs=True)
    in_file = list(stream.records)
    assert [message.data for message in of_type(records.Message, in_file)] == [
        message.data for message in messages
    ]
    seeking = SeekingReader(io.BytesIO(data), validate_crcs=True)
    assert [metadata_of(record) for record in seeking.iter_metadata()] == of_type(Metadata, items)
    assert [attachment_of(record) for record in seeking.iter_attachments()] == of_type(
        Attachment, items
    )
    header = seeking.get_header()
    assert (header.profile, header.library) == ("ros2", "mcap_tool")


@pytest.mark.parametrize("compression", COMPRESSIONS)
@given(items=ITEMS, chunk_size=st.sampled_from([1, 300, 2**20]))
@FEW
def test_their_readers_read_ours(compression: str, items: list[Item], chunk_size: int) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "ours.mcap"
        write_ours(path, items, compression, chunk_size)
        check_with_their_readers(path, items)
        check_index(path.read_bytes())
        assert read_ours(path) == lines_of(items)


@given(items=ITEMS, more=ITEMS, data=st.data())
@FEW
def test_their_readers_read_ours_that_was_cut_off_and_gone_on_with(
    items: list[Item], more: list[Item], data: st.DataObject
) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "ours.mcap"
        write_ours(path, items, "zstd", 300)
        whole = path.read_bytes()
        path.write_bytes(whole[: data.draw(st.integers(1, len(whole) - 1))])
        lines = tool("read", path)
        tool("resume", path, "lz4", "300", lines=[item.line() for item in more] + ["finish"])
        ours = read_ours(path)
        assert ours == read_ours(path, "verify")
        assert sorted(ours) == sorted(
            [line for line in lines if line.startswith(("message", "metadata", "attachment"))]
            + lines_of(more)
        )
        check_index(path.read_bytes())
        found = messages_of(SeekingReader(io.BytesIO(path.read_bytes()), validate_crcs=True))
        assert sorted(message.line() for message in found) == sorted(
            line for line in ours if line.startswith("message")
        )


@pytest.mark.slow
@given(
    items=ITEMS,
    compression=st.sampled_from(CompressionType),
    chunk_size=st.sampled_from([1, 300, 2**20]),
    index_types=st.sampled_from(
        [IndexType.ALL, IndexType.NONE, IndexType.CHUNK, IndexType.CHUNK | IndexType.MESSAGE]
    ),
    use_chunking=st.booleans(),
    use_statistics=st.booleans(),
    use_summary_offsets=st.booleans(),
    repeat_channels=st.booleans(),
    repeat_schemas=st.booleans(),
    enable_crcs=st.booleans(),
    enable_data_crcs=st.booleans(),
    verify=st.booleans(),
)
@settings(FEW, max_examples=200)
def test_ours_reads_theirs(items: list[Item], verify: bool, **options: object) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "theirs.mcap"
        write_theirs(path, items, **options)
        assert read_ours(path, *["verify"] * verify) == lines_of(items)


def test_their_file_that_was_cut_off_is_gone_on_with(tmp_path: Path) -> None:
    path = tmp_path / "theirs.mcap"
    items = [Message("/step", "Step", 0, time, time, b"data" * 10) for time in range(1000, 1100)]
    write_theirs(path, items, chunk_size=1000)
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    lines = [line for line in tool("read", path) if line.startswith("message")]
    assert len(lines) > 20
    tool("resume", path, "zstd", "300", lines=[items[0].line(), "finish"])
    assert read_ours(path, "verify") == [*lines, items[0].line()]
    check_index(path.read_bytes())
