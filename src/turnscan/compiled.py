"""``njit`` for the kernels of turnscan, with a cache that never runs old machine code.

numba's own cache looks at the file of a kernel alone: a constant or a kernel that it imports may
change, and the old machine code goes on. Here the folder of a kernel's machine code is named by a
hash of its module, of all that the module imports from turnscan, and of Python, numba and CPU. A
folder of another hash is old and is removed. Kernel modules take ``njit`` from here, and no other
module imports this one: it imports numba.

The folder lies in ``NUMBA_CACHE_DIR`` where that is set, else beside the sources, else, where
those cannot be written, in the user's cache folder; where nothing can be written each process
compiles for itself.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import logging
import os
import platform
import re
import shutil
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, TypeVar

import llvmlite
import llvmlite.binding
import numba
from numba.core.caching import CompileResultCacheImpl, FunctionCache, UserProvidedCacheLocator
from numba.core.targetconfig import ConfigStack, TargetConfig
from numba.core.types import unliteral  # type: ignore[attr-defined]
from numba.core.types.functions import BaseFunction
from numba.extending import overload
from numba.misc.appdirs import user_cache_dir
from numba.np import arrayobj

from turnscan.locking import take

_LOG = logging.getLogger(__name__)
_PACKAGE = Path(__file__).parent
_IMPORT = re.compile(rb"^\s*(?:from|import)\s+turnscan((?:\.\w+)*)", re.MULTILINE)
_USES = re.compile(rb"^from turnscan\.compiled import", re.MULTILINE)
_UNLIKE = "cannot assign an array to a slice of another shape"
_PATIENCE = 120.0
"""s: longest wait for another process that compiles the same kernel; then we compile it too."""

Kernel = TypeVar("Kernel", bound=Callable[..., object])


def njit(*, cache: bool = True, **options: Any) -> Callable[[Kernel], Kernel]:
    """``numba.njit`` whose cached machine code is as new as the sources.

    ``options`` are numba's. ``cache=False`` compiles anew in each process. To compile little no
    kernel has an entry for C, and one kernel's call of another no type of its own for a constant.
    """
    decorate = numba.njit(no_cfunc_wrapper=True, **options)

    def compiled(function: Kernel) -> Kernel:
        dispatcher: Any = decorate(function)
        if hasattr(dispatcher, "_cache"):  # none with NUMBA_DISABLE_JIT
            dispatcher.get_call_template = functools.partial(_typed_call, dispatcher)
            if cache and _folder(Path(function.__code__.co_filename)) is not None:
                dispatcher._cache = _Cache(function)
        kernel: Kernel = dispatcher
        return kernel

    return compiled


def _typed_call(dispatcher: Any, args: Iterable[Any], kws: Mapping[str, Any]) -> Any:
    """numba's typing of a call within a kernel, where 5 is a whole number like any other.

    numba would compile the callee for the constant, and again for the variable that it becomes.
    """
    plain = {name: unliteral(given) for name, given in kws.items()}
    call = type(dispatcher).get_call_template
    return call(dispatcher, tuple(unliteral(given) for given in args), plain)


def unlike_shapes(source: Any, place: Any) -> None:
    """What a kernel calls where it assigns an array to a slice of another shape (ValueError)."""
    raise ValueError(_UNLIKE)


@overload(unlike_shapes)  # type: ignore[untyped-decorator]
def _unlike_shapes(source: Any, place: Any) -> Callable[[Any, Any], None]:
    def refuse(source: Any, place: Any) -> None:
        raise ValueError(_UNLIKE)

    return refuse


# numba's own names both shapes, and compiles half of its text library for that sentence into each
# kernel with such an assignment: a sixth of all the time of compiling (`turnscan precompile`).
arrayobj.raise_with_shape_context = unlike_shapes

_resolve: Any = BaseFunction.get_call_type
_same_options: Any = TargetConfig.__eq__


def _remembered(function: Any, context: Any, args: Iterable[Any], kws: Mapping[str, Any]) -> Any:
    """numba's typing of a call of one of its own functions, which it forgets after each call.

    ``a + b`` of two numbers is asked for hundreds of times in a kernel, and each time numba tries
    all kinds of addition that it knows. What it refuses it is asked again: that is the rare case.
    """
    key = (context, tuple(args), tuple(kws.items()), ConfigStack.top_or_none())
    try:
        known = function.__dict__.setdefault("turnscan_known", {})
        found = known.get(key)
    except TypeError:  # an argument that has no hash
        return _resolve(function, context, args, kws)
    if found is None:
        found = _resolve(function, context, args, kws)
        if found is not None:
            known[key] = found
    return found


def _equal_options(options: Any, other: Any) -> Any:
    """numba's comparison of what two functions are compiled with, the quick case first.

    numba asks at each call within a kernel, and collects all fifty options of both.
    """
    if options is other or (type(options) is type(other) and options._values == other._values):
        return True
    return _same_options(options, other)


def _hash_of_options(options: Any) -> int:
    """As good as numba's, which sorts the names of all options: they are the same in a class."""
    return hash(type(options))


# A seventh of all the time of compiling, together; the machine code is the same.
BaseFunction.get_call_type = _remembered  # type: ignore[method-assign, assignment]
TargetConfig.__eq__ = _equal_options
TargetConfig.__hash__ = _hash_of_options


def kept_in() -> Path | None:
    """The folder that machine code is kept in; None where none can be written."""
    return _base()


def is_first_run() -> bool:
    """Whether this is asked for the first time where machine code is kept."""
    base = _base()
    if base is None:
        return False
    try:
        (base / "begun").touch(exist_ok=False)
    except OSError:
        return False
    return True


def state_of_sources() -> str:
    """Hash of all that the machine code of all kernels depends on."""
    modules = sorted(p for p in _PACKAGE.rglob("*.py") if _USES.search(p.read_bytes()))
    return hashlib.sha256("".join(map(_key, modules)).encode()).hexdigest()


def was_compiled(part: str, state: str) -> bool:
    """Whether `note_compiled` was said of this part and state, and all machine code is still there.

    Another version of turnscan in the same place removes what it has no use for.
    """
    base = _base()
    try:
        lines = [] if base is None else (base / f"{part}.compiled").read_text().splitlines()
    except (OSError, UnicodeError):
        return False
    return lines[:1] == [state] and all((Path(str(base)) / name).is_dir() for name in lines[1:])


def note_compiled(part: str, state: str) -> None:
    """Remember that a part of the kernels was compiled from sources in this state."""
    base = _base()
    if base is None:
        return
    folders = sorted(p.name for p in base.iterdir() if p.is_dir())
    with contextlib.suppress(OSError):  # then it is compiled again, which takes time alone
        (base / f"{part}.compiled").write_text("\n".join([state, *folders]))


@functools.cache
def _folder(module: Path) -> Path | None:
    """Where the machine code of a module's kernels lies, made and empty if it is new."""
    try:
        name = ".".join(module.relative_to(_PACKAGE).with_suffix("").parts)
        key = _key(module)
    except (OSError, ValueError):  # a bundle without its sources
        return None
    cpu = re.sub(r"\W", "-", llvmlite.binding.get_host_cpu_name())
    kind = f"{name}.{sys.implementation.cache_tag}-{cpu}-"
    base = _base()
    if base is None:
        return None
    folder = base / (kind + key)
    if not folder.is_dir():
        with contextlib.suppress(OSError):
            folder.mkdir()
            _remove_old(base, kind, folder)
    return folder


def _key(module: Path) -> str:
    """Hash of all that the machine code of a module's kernels depends on."""
    versions = (numba.__version__, llvmlite.__version__, platform.python_version())
    digest = hashlib.sha256(repr(versions).encode())
    for path in sorted(_sources(module)):
        digest.update(repr((path.relative_to(_PACKAGE).as_posix(), path.stat().st_size)).encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def _sources(module: Path) -> set[Path]:
    """The module and all that it imports from turnscan, directly or not."""
    found = {module}
    waiting = [module]
    while waiting:
        new = _imported(waiting.pop()) - found
        found |= new
        waiting += new
    return found


@functools.cache
def _imported(module: Path) -> frozenset[Path]:
    """The files of turnscan that a file imports; of a package all its modules."""
    found: set[Path] = set()
    for dotted in _IMPORT.findall(module.read_bytes()):
        path = _PACKAGE.joinpath(*dotted.decode().split(".")[1:])
        found |= set(path.rglob("*.py")) if path.is_dir() else {path.with_suffix(".py")}
    return frozenset(found)


@functools.cache
def _base() -> Path | None:
    """The folder of all machine code of this copy of turnscan; None where none can be written."""
    own = f"turnscan-{hashlib.sha256(os.fsencode(_PACKAGE)).hexdigest()[:8]}"
    given = numba.config.CACHE_DIR
    places = [Path(given, own)] if given else []
    places.append(_PACKAGE / "__pycache__" / "kernels")
    places.append(Path(user_cache_dir("turnscan", appauthor=False), own))
    for place in places:
        with contextlib.suppress(OSError):
            place.mkdir(mode=0o700, parents=True, exist_ok=True)
            tempfile.TemporaryFile(dir=place).close()
            if not any(place.iterdir()):
                _LOG.warning("compiling for this machine, once: this first run takes a minute more")
            return place
    return None


def _remove_old(base: Path, kind: str, folder: Path) -> None:
    """Remove what older sources left of one module.

    A process of the older sources may still run: it finds nothing, compiles and makes its folder
    again, or keeps what it compiled to itself.
    """
    for other in base.glob(kind + "*"):
        if other != folder:
            shutil.rmtree(other, ignore_errors=True)


class _Locator(UserProvidedCacheLocator):  # type: ignore[misc]
    """Gives numba the folder."""

    def __init__(self, function: Callable[..., Any], path: str) -> None:
        super().__init__(function, path)
        self._cache_path = str(_folder(Path(path)))

    @classmethod
    def from_function(cls, function: Callable[..., Any], path: str) -> _Locator:
        return cls(function, path)


class _Implementation(CompileResultCacheImpl):  # type: ignore[misc]
    _locator_classes = (_Locator,)


class _Cache(FunctionCache):  # type: ignore[misc]
    """numba's cache of one kernel, compiled by one process at a time.

    Two that compile different signatures at once would both write them as number 1, and the index
    of one could name the code of the other.
    """

    _impl_class = _Implementation

    def __init__(self, function: Callable[..., Any]) -> None:
        super().__init__(function)
        self._lock = -1

    def load_overload(self, signature: Any, target: Any) -> Any:
        """The machine code from the disk, or None: then the caller compiles and saves it."""
        found = super().load_overload(signature, target)
        if found is None and self._lock < 0:
            self._wait()
            found = super().load_overload(signature, target)
            if found is not None:
                self._release()
        return found

    def save_overload(self, signature: Any, compiled: Any) -> None:
        """Write the machine code; where that fails it lives as long as this process."""
        try:
            with contextlib.suppress(OSError):
                super().save_overload(signature, compiled)
        finally:
            self._release()

    def _wait(self) -> None:
        path = Path(self.cache_path) / f"{self._impl.filename_base}.lock"
        try:
            self._lock = os.open(path, os.O_RDWR | os.O_CREAT, 0o600)
        except OSError:  # removed by a newer turnscan
            return
        end = time.monotonic() + _PATIENCE
        while not take(self._lock) and time.monotonic() < end:
            time.sleep(0.02)

    def _release(self) -> None:
        lock, self._lock = self._lock, -1
        if lock >= 0:
            os.close(lock)
