"""Logs to read: one written by the reference writer, one by the virtual vehicle."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import pytest
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from mcap_protobuf.writer import Writer

START_NS = 1_790_000_000_000_000_000
FIELD = descriptor_pb2.FieldDescriptorProto


def _field(message: Any, name: str, number: int, kind: int, **more: Any) -> None:
    label = more.pop("label", FIELD.LABEL_OPTIONAL)
    message.field.add(name=name, number=number, type=kind, label=label, **more)


def _message_class() -> Any:
    """A message with every type that a log may hold, absent values and lists."""
    file = descriptor_pb2.FileDescriptorProto(
        name="test/everything.proto", package="test", syntax="proto3"
    )
    inner = file.message_type.add(name="Inner")
    _field(inner, "x", 1, FIELD.TYPE_DOUBLE)
    _field(inner, "count", 2, FIELD.TYPE_SINT64)
    outer = file.message_type.add(name="Everything")
    _field(outer, "f64", 1, FIELD.TYPE_DOUBLE)
    _field(outer, "f32", 2, FIELD.TYPE_FLOAT)
    _field(outer, "i32", 3, FIELD.TYPE_INT32)
    _field(outer, "s32", 4, FIELD.TYPE_SINT32)
    _field(outer, "sf32", 5, FIELD.TYPE_SFIXED32)
    _field(outer, "u32", 6, FIELD.TYPE_UINT32)
    _field(outer, "x32", 7, FIELD.TYPE_FIXED32)
    _field(outer, "i64", 8, FIELD.TYPE_INT64)
    _field(outer, "sf64", 9, FIELD.TYPE_SFIXED64)
    _field(outer, "u64", 10, FIELD.TYPE_UINT64)
    _field(outer, "x64", 11, FIELD.TYPE_FIXED64)
    _field(outer, "flag", 12, FIELD.TYPE_BOOL)
    _field(outer, "text", 13, FIELD.TYPE_STRING)
    _field(outer, "data", 14, FIELD.TYPE_BYTES)
    _field(outer, "inner", 15, FIELD.TYPE_MESSAGE, type_name=".test.Inner")
    repeated = FIELD.LABEL_REPEATED
    _field(outer, "list", 16, FIELD.TYPE_DOUBLE, label=repeated)
    _field(outer, "parts", 17, FIELD.TYPE_MESSAGE, type_name=".test.Inner", label=repeated)
    for index, (name, number, kind) in enumerate(
        [
            ("maybe_u32", 18, FIELD.TYPE_UINT32),
            ("maybe_i64", 19, FIELD.TYPE_INT64),
            ("maybe_f64", 20, FIELD.TYPE_DOUBLE),
        ]
    ):
        _field(outer, name, number, kind, proto3_optional=True, oneof_index=index)
        outer.oneof_decl.add(name=f"_{name}")
    pool = descriptor_pool.DescriptorPool()
    pool.Add(file)
    return message_factory.GetMessageClass(pool.FindMessageTypeByName("test.Everything"))


def everything() -> list[Any]:
    """The messages of the reference log."""
    kind = _message_class()
    full = kind(
        f64=1.0 / 3.0,
        f32=0.5,
        i32=-(2**31),
        s32=-5,
        sf32=-6,
        u32=2**32 - 1,
        x32=7,
        i64=-(2**63),
        sf64=-8,
        u64=2**64 - 1,
        x64=2**63,
        flag=True,
        text="Grüße",
        data=b"\x00\xff",
        inner={"x": 0.0, "count": -9},
        list=[1.0, 2.0, 3.0],
        parts=[{"x": 4.0}, {"count": 5}],
        maybe_u32=0,
        maybe_i64=2**53 + 1,
        maybe_f64=0.0,
    )
    return [full, kind(), kind(f64=-0.0, parts=[{"x": 6.0}], maybe_u32=12)]


@pytest.fixture
def reference_log(tmp_path: Path) -> Path:
    """A log written by the reference writer: 3 messages, 10 ms apart."""
    path = tmp_path / "reference.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream)
        for index, message in enumerate(everything()):
            time_ns = START_NS + 10_000_000 * index
            writer.write_message(
                topic="/everything",
                message=message,
                log_time=time_ns,
                publish_time=time_ns - 2_000_000,
            )
        writer.finish()
    return path


@pytest.fixture
def simulated_log() -> Path:
    """A log of the virtual vehicle, named by ATVREC_TEST_LOG."""
    path = os.environ.get("ATVREC_TEST_LOG")
    if not path:
        pytest.skip("ATVREC_TEST_LOG names no log; scripts/test-python makes one")
    return Path(path)
