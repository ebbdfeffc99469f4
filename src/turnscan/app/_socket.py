"""The WebSocket: requests in, within their limits, and what the hub has to tell out."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import time
from typing import Any

from pydantic import ValidationError
from starlette.websockets import WebSocket, WebSocketDisconnect, WebSocketState

from turnscan.app._envelope import Array, unpack
from turnscan.app._hub import Client
from turnscan.app._protocol import Beat, Refused
from turnscan.app._request_guard import is_loopback
from turnscan.app._requests import REQUESTS, Ack, ClientMessage
from turnscan.app._workshop import Workshop
from turnscan.errors import FormatError, InputError

MESSAGE_BYTES = 4 * 2**20
"""A selection of a surface of 28 million faces, with a bit for each, and its header."""
SEND_SECONDS = 10.0
"""s that a message may take; who reads slower is hung up on."""
BEAT_SECONDS = 0.25
"""s from one sign of life to the next: a page that hears none for 0.8 s says so."""
_NOT_A_MESSAGE, _BAD_REQUEST, _TOO_MUCH, _BEHIND, _FULL = 1003, 1008, 1008, 1013, 1013

_TYPED = {
    "string_too_short": "may not be empty",
    "string_too_long": "has more than {max_length} characters",
    "string_unicode": "has half a character: type it again",
    "greater_than": "must be above {gt}",
    "greater_than_equal": "must be at least {ge}",
    "less_than": "must be below {lt}",
    "less_than_equal": "must be at most {le}",
}
"""What a person can do wrong in a field, by pydantic's word for it; our page does nothing else."""

_log = logging.getLogger("turnscan.app")


async def socket(websocket: WebSocket) -> None:
    """One browser, from its coming to its going."""
    workshop: Workshop = websocket.scope["workshop"]
    address = websocket.client.host if websocket.client else ""
    client = Client(not is_loopback(address), websocket.scope["browser"])
    await websocket.accept()
    if not workshop.hub.join(client):
        await websocket.close(_FULL, "too many browsers are connected")
        return
    # The list of scans looks at every file of the folder: others are served meanwhile.
    await asyncio.to_thread(workshop.greet, client)
    workshop.hub.tell_control()
    workshop.rig.tell(to=client)
    sending = asyncio.create_task(_send(websocket, client))
    receiving = asyncio.create_task(_receive(websocket, client, workshop))
    beating = asyncio.create_task(_beat(workshop, client))
    try:
        _, left = await asyncio.wait((sending, receiving), return_when=asyncio.FIRST_COMPLETED)
    finally:
        workshop.hub.leave(client)
        for task in (sending, receiving, beating):
            task.cancel()
    await asyncio.gather(*left, return_exceptions=True)
    for task in (sending, receiving):
        if not task.cancelled() and task.exception() is not None:
            _log.error("internal error (%s) at /ws", type(task.exception()).__name__)


async def _send(websocket: WebSocket, client: Client) -> None:
    while (message := await client.next()) is not None:
        kind = "bytes" if isinstance(message, bytes) else "text"
        try:
            async with asyncio.timeout(SEND_SECONDS):
                await websocket.send({"type": "websocket.send", kind: message})
        except (TimeoutError, WebSocketDisconnect, RuntimeError):
            return
    await _close(websocket, _BEHIND, "this browser is too slow or has disconnected")


async def _beat(workshop: Workshop, client: Client) -> None:
    while True:
        workshop.hub.tell(Beat(), to=client)
        await asyncio.sleep(BEAT_SECONDS)


async def _receive(websocket: WebSocket, client: Client, workshop: Workshop) -> None:
    allowance = workshop.hub.allowances.of(websocket.scope["browser"])
    while True:
        received = await websocket.receive()
        if received["type"] == "websocket.disconnect":
            return
        if not allowance.take():
            await _close(websocket, _TOO_MUCH, "too many messages")
            return
        data = received.get("bytes") or received.get("text") or ""
        try:
            body, arrays = _parse(data)
        except InputError as e:
            await _close(websocket, _NOT_A_MESSAGE, e.message[:100])
            return
        try:
            request: ClientMessage = REQUESTS.validate_python(body)
        except ValidationError as e:
            if not await _refused(websocket, body, e):
                return
            continue
        if isinstance(request, Ack):
            client.unshown.discard(request.number)
            continue
        client.seen = time.monotonic()
        workshop.answer(client, request, arrays)


def _parse(data: str | bytes) -> tuple[dict[str, Any], dict[str, Array]]:
    """A request and its arrays. Raises InputError where it is none."""
    from turnscan.json_text import strict_json

    if isinstance(data, bytes):
        return unpack(data)
    if len(data.encode()) > MESSAGE_BYTES:
        raise FormatError(f"message: more than {MESSAGE_BYTES >> 20} MB")
    body = strict_json(data, "message")
    if not isinstance(body, dict):
        raise FormatError("message: not an object")
    return body, {}


async def _refused(websocket: WebSocket, body: dict[str, Any], e: ValidationError) -> bool:
    """Say what was wrong; hang up, and return False, unless a person may have typed it."""
    first = e.errors(include_url=False, include_input=False)[0]
    typed = _TYPED.get(first["type"])
    # The first word of the place is the kind of the request, of which nobody has heard.
    where = ".".join(str(k) for k in first["loc"][1:] or first["loc"])[:100]
    why = typed.format(**first.get("ctx", {})) if typed else first["msg"]
    number = body.get("id")
    known = type(number) is int and 0 <= number < 2**53
    answer = Refused(
        id=number if known else None,
        code="bad-request",
        text=f"{where or 'request'}: {why}"[:300],
        hint="correct it, then repeat" if typed else "reload the page",
    )
    with contextlib.suppress(WebSocketDisconnect, RuntimeError):
        await websocket.send_text(answer.model_dump_json())
    if typed is None or not known:
        await _close(websocket, _BAD_REQUEST, "bad request")
        return False
    return True


async def _close(websocket: WebSocket, code: int, reason: str) -> None:
    if websocket.application_state is WebSocketState.CONNECTED:
        with contextlib.suppress(WebSocketDisconnect, RuntimeError):
            await websocket.close(code, reason)
