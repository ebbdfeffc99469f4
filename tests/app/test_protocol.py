"""The protocol: one definition in Python, and the front end's types are what it gives."""

from __future__ import annotations

import importlib.util
import json
import struct
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from turnscan.app import _envelope as envelope
from turnscan.app import _requests as requests
from turnscan.errors import InputError

FRONTEND = Path(__file__).parents[2] / "frontend"


def test_types_and_colours_of_the_front_end_are_generated() -> None:
    spec = importlib.util.spec_from_file_location("make_protocol", FRONTEND / "make_protocol.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    for file, made in module.FILES.items():
        assert file.read_text() == made(), "run python frontend/make_protocol.py"
    for kind in ("hello", "patch", "frame", "edit", "stop"):
        assert f'kind: "{kind}";' in module.typescript()


@given(
    st.lists(
        st.sampled_from(sorted(envelope.DTYPES.values())).flatmap(
            lambda code: hnp.arrays(
                np.dtype(code), hnp.array_shapes(min_dims=1, max_dims=3, min_side=0, max_side=5)
            )
        ),
        max_size=5,
    )
)
def test_an_envelope_gives_back_what_was_put_into_it(arrays: list[envelope.Array]) -> None:
    named = {f"a{k}": a for k, a in enumerate(arrays)}
    header, back = envelope.unpack(envelope.pack({"kind": "x", "text": "höhe"}, named))
    assert header == {"kind": "x", "text": "höhe"}
    assert list(back) == list(named)
    for name, a in named.items():
        assert back[name].dtype == a.dtype
        np.testing.assert_array_equal(back[name], a)


def _message(header: object, rest: bytes = b"") -> bytes:
    text = json.dumps(header).encode()
    return struct.pack("<I", len(text)) + text + bytes(-(4 + len(text)) % 8) + rest


@pytest.mark.parametrize(
    "message",
    [
        b"",
        b"\x01\x00",
        b"\xff\xff\xff\xff{}",
        struct.pack("<I", 2) + b"[]",
        struct.pack("<I", 3) + b"\xff\xfe\xfd",
        struct.pack("<I", 12) + b'{"a":1,"a":2}'[:12],
        _message({"arrays": 3}),
        _message({"arrays": [{"name": "a", "dtype": "f32"}]}),
        _message({"arrays": [{"name": "a", "dtype": "object", "shape": [1]}]}),
        _message({"arrays": [{"name": "a", "dtype": "f32", "shape": [2**31, 2**31]}]}),
        _message({"arrays": [{"name": "a", "dtype": "f32", "shape": [-1]}]}, bytes(8)),
        _message({"arrays": [{"name": "a", "dtype": "f32", "shape": [True]}]}, bytes(8)),
        _message({"arrays": [{"name": "a", "dtype": "f32", "shape": [3]}]}, bytes(8)),
        _message({"arrays": [{"name": "a", "dtype": "u8", "shape": [1]}] * 2}, bytes(16)),
        _message({"arrays": [{"name": "a", "dtype": "u8", "shape": [0]}] * 65}, bytes(16)),
        _message({"x": float("nan")}),
    ],
)
def test_an_envelope_that_lies_is_refused(message: bytes) -> None:
    with pytest.raises(InputError):
        envelope.unpack(message)


@given(st.binary(max_size=200))
def test_any_bytes_are_an_envelope_or_refused(message: bytes) -> None:
    try:
        header, _ = envelope.unpack(message)
    except InputError:
        return
    assert isinstance(header, dict)


@pytest.mark.parametrize(
    "text",
    [
        "{}",
        '{"kind":"undo","id":1}',
        '{"kind":"undo","id":1,"scan":"../../etc"}',
        '{"kind":"undo","id":-1,"scan":"abcdefgh"}',
        '{"kind":"undo","id":1,"scan":"abcdefgh","extra":1}',
        '{"kind":"turn","id":1,"angle_deg":1e9}',
        '{"kind":"fire","id":1}',
    ],
)
def test_a_request_that_is_none_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match="valid"):
        requests.REQUESTS.validate_json(text)
