"""Routes: what can be asked for by HTTP. Who may ask is judged by the doors before."""

from __future__ import annotations

import asyncio
import gzip
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, TypeVar

from pydantic import ValidationError
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, Response
from starlette.routing import BaseRoute, Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.types import Receive, Scope, Send

from turnscan.app import _protocol as p
from turnscan.app import _requests as q
from turnscan.app._auth import Keys
from turnscan.app._encode_arrays import encoded
from turnscan.app._envelope import Array, pack
from turnscan.app._export import export_job
from turnscan.app._open_scan import OpenScan
from turnscan.app._request_guard import problem
from turnscan.app._socket import socket
from turnscan.app._workshop import Workshop
from turnscan.errors import InputError, ScanError
from turnscan.memory import give_back
from turnscan.workflows import TARGET, NotOpen, artefact, duplicate_scan, mesh_file_arrays

HERE = Path(__file__).parent
STATIC, LOGIN = HERE / "static", HERE / "login"
ENVELOPE = "application/x-turnscan"
UPLOADS = frozenset({"/api/scans", "/api/files", "/api/uploads"})
"""Paths whose bodies are files."""
_FOREVER = "public, max-age=31536000, immutable"
_REPORT_POLICY = "sandbox; default-src 'none'; style-src 'unsafe-inline'; img-src data:"
"""A report is of the folder, where anybody may have put it: it runs nothing."""
_LARGE = 8 * 2**20
"""Bytes from which on what a message was made from goes back to the system at once."""
_SQUEEZE = 1
"""Level of gzip: fast; meshes shrink to about a half."""

B = TypeVar("B", bound=p.Model)
Answer = tuple[p.Model, Mapping[str, Array]]
Endpoint = Callable[[Request], Awaitable[Response]]


def routes(workshop: Workshop, keys: Keys, cookie: str) -> list[BaseRoute]:
    """All routes. Nothing that is GET changes anything."""
    return [
        Route("/login", _login_page, methods=["GET"]),
        Route("/login", _enter(keys, cookie), methods=["POST"]),
        Route("/login.js", _file(LOGIN / "login.js")),
        Route("/login.css", _file(LOGIN / "login.css")),
        Route("/api/stop", _stop(workshop), methods=["POST"]),
        Route("/api/scans", _add_scan(workshop), methods=["POST"]),
        Route("/api/files", _add_file(workshop), methods=["POST"]),
        Route("/api/uploads", _upload(workshop), methods=["POST"]),
        Route("/api/uploads/{upload}", _uploaded(workshop), methods=["GET"]),
        Route("/api/files/{file}", _file_of(workshop), methods=["GET"]),
        Route("/api/files/{file}/page", _page_of(workshop)),
        Route("/api/files/{file}/mesh", _mesh_of(workshop)),
        Route("/api/calibration/{view:int}.jpg", _calibration_picture(workshop)),
        *(Route(f"/api/{form}.pdf", _sheet_of(form)) for form in ("target", "dial")),
        Route("/api/scans/{scan}/thumbnail.png", _thumbnail(workshop)),
        Route("/api/scans/{scan}/file", _scan_file(workshop)),
        Route("/api/scans/{scan}/mesh", _data(workshop, _mesh)),
        Route("/api/scans/{scan}/edits", _data(workshop, lambda scan, request: scan.touched())),
        Route("/api/scans/{scan}/quality", _data(workshop, lambda scan, request: scan.quality())),
        Route("/api/scans/{scan}/steps/{picture}.png", _step_picture(workshop)),
        Route("/api/scans/{scan}/grid/{grid:int}", _data(workshop, _grid)),
        Route("/api/scans/{scan}/profile/{grid:int}/{step:int}", _data(workshop, _profile)),
        Route("/api/scans/{scan}/picture/{grid:int}/{step:int}.png", _picture(workshop)),
        Route("/api/scans/{scan}/exports", _export(workshop), methods=["POST"]),
        Route("/api/downloads/{download}", _download(workshop)),
        Route("/api/invitations", _invite(keys), methods=["POST"]),
        Route("/api/logout", _logout(keys, cookie), methods=["POST"]),
        WebSocketRoute("/ws", socket),
        Route("/", _file(STATIC / "index.html")),
        Mount("/", _Bundle(directory=STATIC, check_dir=False)),
    ]


class _Bundle(StaticFiles):
    """The front end; what has its hash in its name never changes."""

    def file_response(self, *args: Any, **kwargs: Any) -> Response:
        response = super().file_response(*args, **kwargs)
        hashed = "assets" in Path(args[0]).parts
        response.headers["Cache-Control"] = _FOREVER if hashed else "no-cache"
        return response


def _file(path: Path) -> Endpoint:
    async def page(request: Request) -> Response:
        if not path.is_file():
            return problem(404, "the front end has not been built", "see frontend/README.md")
        return FileResponse(path, headers={"Cache-Control": "no-cache"})

    return page


_login_page = _file(LOGIN / "login.html")


def _enter(keys: Keys, cookie: str) -> Endpoint:
    async def enter(request: Request) -> Response:
        body = await _body(request, q.LoginRequest)
        address = request.client.host if request.client else ""
        wait = keys.wait(address)
        if wait > 0:
            hint = f"wait {wait:.0f} s, then open the link again"
            return problem(429, "too many wrong links", hint, Retry_After=str(int(wait) + 1))
        session = keys.enter(body.token, address)
        if session is None:
            hint = "open the link that turnscan printed last"
            return problem(
                401, "this link has been used already, or belongs to another server", hint
            )
        answer = Response(status_code=204)
        answer.set_cookie(cookie, session, httponly=True, samesite="strict", path="/")
        return answer

    return enter


def _logout(keys: Keys, cookie: str) -> Endpoint:
    async def leave(request: Request) -> Response:
        keys.leave(request.cookies.get(cookie, ""))
        answer = Response(status_code=204)
        answer.delete_cookie(cookie, httponly=True, samesite="strict", path="/")
        return answer

    return leave


def _invite(keys: Keys) -> Endpoint:
    async def invite(request: Request) -> Response:
        return _json(q.Invitation(path=f"/login#{keys.invite()}"))

    return invite


def _add_scan(workshop: Workshop) -> Endpoint:
    async def add(request: Request) -> Response:
        name = request.query_params.get("name", "")
        name = await workshop.library.add(name, *_content(workshop, request))
        await asyncio.to_thread(workshop.tell_scans)
        return _json(q.Added(scan=name), 201)

    return add


def _add_file(workshop: Workshop) -> Endpoint:
    async def add(request: Request) -> Response:
        query = request.query_params
        into, files = await workshop.files.receive(
            query.get("name", ""), query.get("into", ""), *_content(workshop, request)
        )
        await asyncio.to_thread(workshop.tell_files)
        return _json(q.Received(into=into, files=files), 201)

    return add


def _content(workshop: Workshop, request: Request) -> tuple[AsyncIterator[bytes], int | None]:
    """What is sent with a request, or was sent before it in pieces; and its bytes, where known."""
    upload = request.query_params.get("upload")
    if upload is not None:
        return workshop.uploads.take(upload), None
    given = request.headers.get("content-length")
    return request.stream(), int(given) if given is not None else None


def _upload(workshop: Workshop) -> Endpoint:
    """Begin a file of so many ``bytes``, or go on with one ``at`` a byte."""

    async def upload(request: Request) -> Response:
        name, total = request.query_params.get("upload"), _number(request, "bytes", 16)
        if name is None:
            if total is None:
                raise InputError("bytes: no size is given", hint="say how large the file is")
            return _json(q.Uploaded(upload=workshop.uploads.begin(total), received=0), 201)
        at = _number(request, "at", 16) or 0
        return _json(
            q.Uploaded(upload=name, received=await workshop.uploads.add(name, at, request.stream()))
        )

    return upload


def _uploaded(workshop: Workshop) -> Endpoint:
    async def uploaded(request: Request) -> Response:
        name = request.path_params["upload"]
        return _json(q.Uploaded(upload=name, received=workshop.uploads.received(name)))

    return _or_not_found(uploaded)


def _or_not_found(endpoint: Endpoint) -> Endpoint:
    """What cannot be had is answered by 404, with the reason."""

    async def found(request: Request) -> Response:
        try:
            return await endpoint(request)
        except (InputError, ScanError) as e:
            return problem(404, e.message, str(e.hint))

    return found


def _file_of(workshop: Workshop) -> Endpoint:
    async def download(request: Request) -> Response:
        item = workshop.files.find(request.path_params["file"])
        if item.path.is_dir():
            return problem(404, "a folder of pictures", "download its files one by one")
        name = item.path.name
        return FileResponse(item.path, filename=name, media_type="application/octet-stream")

    return _or_not_found(download)


def _page_of(workshop: Workshop) -> Endpoint:
    async def page(request: Request) -> Response:
        item = workshop.files.find(request.path_params["file"])
        if item.path.suffix.lower() != ".html":
            return problem(404, "not a report", "download it")
        headers = {"Content-Security-Policy": _REPORT_POLICY}
        return FileResponse(item.path, media_type="text/html", headers=headers)

    return _or_not_found(page)


def _mesh_of(workshop: Workshop) -> Endpoint:
    """The surface in a file of the folder, for looking at it."""

    async def mesh(request: Request) -> Response:
        item = workshop.files.find(request.path_params["file"])
        if "mesh" not in item.kinds:
            raise InputError(f"{item.name}: not a mesh", hint="choose a mesh file")

        def make() -> Answer:
            lasers, arrays = mesh_file_arrays(item.path)
            return p.FileMeshHeader(lasers=list(lasers)), encoded(arrays)

        return await _envelope(request, make)

    return mesh


def _calibration_picture(workshop: Workshop) -> Endpoint:
    async def picture(request: Request) -> Response:
        data = workshop.calibration.picture(request.path_params["view"])
        return Response(data, media_type="image/jpeg")

    return _or_not_found(picture)


def _sheet_of(form: str) -> Endpoint:
    """A board to print, or a dial for the platter."""

    async def sheet(request: Request) -> Response:
        query = request.query_params
        made = await asyncio.to_thread(
            artefact, form, board=query.get("board", TARGET),
            markers=query.get("markers"), paper=query.get("paper", "a4"),
        )  # fmt: skip
        (name, data), *_ = made.items()
        headers = {"Content-Disposition": f'attachment; filename="{name}"'}
        return Response(data, media_type="application/pdf", headers=headers)

    return sheet


def _thumbnail(workshop: Workshop) -> Endpoint:
    async def thumbnail(request: Request) -> Response:
        scan = request.path_params["scan"]
        try:
            png = await asyncio.to_thread(workshop.thumbnail, scan)
        except (InputError, ScanError):
            # Renamed or binned while a page that does not know it yet was asking: no error of its.
            if await asyncio.to_thread(workshop.library.gone, scan):
                return Response(status_code=204)
            raise
        # The address names the content: another one has another address.
        kept = {"Cache-Control": "private, max-age=86400"}
        return Response(png, media_type="image/png", headers=kept)

    return _or_not_found(thumbnail)


def _step_picture(workshop: Workshop) -> Endpoint:
    async def picture(request: Request) -> Response:
        png = await asyncio.to_thread(workshop.pictures.get, request.path_params["picture"])
        return Response(png, media_type="image/png", headers={"Cache-Control": _FOREVER})

    return _or_not_found(picture)


def _scan_file(workshop: Workshop) -> Endpoint:
    async def download(request: Request) -> Response:
        path = workshop.library.path(request.path_params["scan"])
        copy = workshop.downloads.place()
        # A plain copy of a file that is open lacks its last edits.
        await asyncio.to_thread(duplicate_scan, path, copy)
        return PassingFile(copy, filename=path.name, media_type="application/octet-stream")

    return _or_not_found(download)


class PassingFile(FileResponse):
    """A temporary file, removed when it was sent, and also where the browser hung up before."""

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        try:
            await super().__call__(scope, receive, send)
        finally:
            Path(self.path).unlink(missing_ok=True)


def _data(workshop: Workshop, make: Callable[[OpenScan, Request], Answer]) -> Endpoint:
    async def data(request: Request) -> Response:
        scan = _opened(workshop, request)
        return await _envelope(request, lambda: make(scan, request))

    return data


async def _envelope(request: Request, make: Callable[[], Answer]) -> Response:
    """Made in a thread; squeezed where the browser can."""

    def build() -> bytes:
        header, arrays = make()
        message = pack(header.model_dump(mode="json"), arrays)
        if len(message) > _LARGE:
            del arrays
            give_back()
        return gzip.compress(message, _SQUEEZE) if squeeze else message

    squeeze = "gzip" in request.headers.get("accept-encoding", "")
    body = await asyncio.to_thread(build)
    headers = {"Content-Encoding": "gzip"} if squeeze else {}
    return Response(body, media_type=ENVELOPE, headers=headers)


def _mesh(scan: OpenScan, request: Request) -> Answer:
    faces = _number(request, "faces")
    return scan.mesh() if faces is None else scan.stand_in(faces)


def _grid(scan: OpenScan, request: Request) -> Answer:
    return scan.grid(request.path_params["grid"], _number(request, "step"))


def _profile(scan: OpenScan, request: Request) -> Answer:
    return scan.profile(request.path_params["grid"], request.path_params["step"])


def _picture(workshop: Workshop) -> Endpoint:
    async def picture(request: Request) -> Response:
        scan = _opened(workshop, request)
        place = request.path_params["grid"], request.path_params["step"]
        return Response(await asyncio.to_thread(scan.picture, *place), media_type="image/png")

    return picture


def _stop(workshop: Workshop) -> Endpoint:
    """STOP of a browser whose socket is not open at the moment."""

    async def stop(request: Request) -> Response:
        own = ThreadPoolExecutor(1, "stop")  # the threads of all others may be at work
        try:
            await asyncio.get_running_loop().run_in_executor(own, workshop.stop)
        finally:
            own.shutdown(wait=False)
        return Response(status_code=204)

    return stop


def _export(workshop: Workshop) -> Endpoint:
    async def start(request: Request) -> Response:
        scan = _opened(workshop, request)
        asked = await _body(request, q.ExportRequest)
        job = export_job(workshop.jobs, workshop.downloads, scan, asked)
        return _json(q.StartedExport(job=job.id), 202)

    return start


def _download(workshop: Workshop) -> Endpoint:
    async def download(request: Request) -> Response:
        path, name = workshop.downloads.find(request.path_params["download"])
        return FileResponse(path, filename=name, media_type="application/octet-stream")

    return _or_not_found(download)


def _opened(workshop: Workshop, request: Request) -> OpenScan:
    try:
        return workshop.opened(request.path_params["scan"])
    except NotOpen:
        raise
    except InputError:
        raise HTTPException(404) from None


async def _body(request: Request, model: type[B]) -> B:
    """The body as a model. Raises InputError naming the key."""
    try:
        return model.model_validate_json(await request.body())
    except ValidationError as e:
        first = e.errors(include_url=False, include_context=False, include_input=False)[0]
        where = ".".join(str(k) for k in first["loc"]) or "body"
        raise InputError(f"{where}: {first['msg']}") from None


def _json(model: p.Model, status: int = 200) -> Response:
    return JSONResponse(model.model_dump(mode="json"), status)


def _number(request: Request, key: str, digits: int = 9) -> int | None:
    """A number of the query. Raises InputError for what is none."""
    text = request.query_params.get(key)
    if text is None:
        return None
    if not (text.isascii() and text.isdigit() and len(text) <= digits):
        raise InputError(f"{key}: not a number")
    return int(text)
