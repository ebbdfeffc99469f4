"""Keys: tokens that let a browser in once, and the cookies it gets for them."""

from __future__ import annotations

import hashlib
import hmac
import secrets
import threading
import time
from collections import OrderedDict, deque
from collections.abc import Callable

TOKEN_BYTES = 32
TOKEN_SECONDS = 12 * 3600.0
"""s that a token may wait for its browser."""
SESSION_SECONDS = 7 * 24 * 3600.0
"""s that a cookie is good for after it was last used."""
FAILURES = 5
"""Wrong tokens a minute from one address before it has to wait …"""
WAIT = 5.0
"""… s for the next one, and twice as long for each after that."""
_LONGEST_WAIT = 300.0
_ADDRESSES = 1000
_SESSIONS = 64


class Keys:
    """Tokens and sessions; only their digests are kept. All methods may be called from any thread.

    Digests are compared in constant time, and all of them each time.
    """

    def __init__(
        self,
        clock: Callable[[], float] = time.monotonic,
        spent: Callable[[], None] = lambda: None,
    ) -> None:
        """``spent`` is called when a token has let somebody in, and is good no more."""
        self._clock, self._spent = clock, spent
        self._lock = threading.Lock()
        self._tokens: dict[bytes, float] = {}
        self._sessions: OrderedDict[bytes, float] = OrderedDict()
        self._failed: OrderedDict[str, deque[float]] = OrderedDict()

    def invite(self) -> str:
        """A token that is good once."""
        token = secrets.token_urlsafe(TOKEN_BYTES)
        with self._lock:
            now = self._clock()
            self._tokens = {d: until for d, until in self._tokens.items() if until > now}
            self._tokens[_digest(token)] = now + TOKEN_SECONDS
        return token

    def wait(self, address: str) -> float:
        """s before somebody from this address may try a token again."""
        with self._lock:
            failed = self._failed.get(address)
            if failed is None or len(failed) < FAILURES:
                return 0.0
            wait = min(WAIT * 2.0 ** (len(failed) - FAILURES), _LONGEST_WAIT)
            return max(0.0, failed[-1] + wait - self._clock())

    def enter(self, token: str, address: str) -> str | None:
        """The cookie for a token, which is then spent; None for one that is not good."""
        digest, now = _digest(token), self._clock()
        with self._lock:
            good = _find(digest, self._tokens)
            if good is None or self._tokens.pop(good) <= now:
                self._fail(address, now)
                return None
            self._failed.pop(address, None)
            cookie = secrets.token_urlsafe(TOKEN_BYTES)
            self._sessions[_digest(cookie)] = now + SESSION_SECONDS
            while len(self._sessions) > _SESSIONS:
                self._sessions.popitem(last=False)
        self._spent()
        return cookie

    def known(self, cookie: str) -> bool:
        """Whether a cookie is one of ours and still good."""
        with self._lock:
            session, now = _find(_digest(cookie), self._sessions), self._clock()
            if session is None or self._sessions[session] <= now:
                return False
            self._sessions[session] = now + SESSION_SECONDS
            self._sessions.move_to_end(session)
            return True

    def leave(self, cookie: str) -> None:
        """A cookie is good no more."""
        with self._lock:
            self._sessions.pop(_digest(cookie), None)

    def _fail(self, address: str, now: float) -> None:
        failed = self._failed.setdefault(address, deque(maxlen=FAILURES + 8))
        while failed and failed[0] < now - max(60.0, _LONGEST_WAIT):
            failed.popleft()
        if len(failed) < FAILURES:
            while failed and failed[0] < now - 60.0:
                failed.popleft()
        failed.append(now)
        self._failed.move_to_end(address)
        while len(self._failed) > _ADDRESSES:
            self._failed.popitem(last=False)


def _digest(secret: str) -> bytes:
    return hashlib.sha256(secret.encode("utf-8", "surrogatepass")).digest()


def _find(digest: bytes, among: dict[bytes, float]) -> bytes | None:
    found = None
    for known in among:
        if hmac.compare_digest(known, digest):
            found = known
    return found
