"""Clients of a server: `Client` waits, `AsyncClient` is awaited. Both have the same methods."""

from __future__ import annotations

import asyncio
import functools
import inspect
import os
import re
import time
from collections.abc import AsyncIterator, Callable, Coroutine, Iterator, Mapping
from typing import Any, Concatenate, ParamSpec, TypeVar
from urllib.parse import urlsplit

import httpx

from . import operations, outputs
from . import sweeps as of_sweeps
from . import webhooks as of_webhooks
from .exchange import Answer, Call, Give, Manners, More, Open, Pause, Step, Talk
from .models import Delivery, Job, Sweep
from .recording import Frame

P = ParamSpec("P")
T = TypeVar("T")
M = TypeVar("M", bound=Callable[..., Any])
Operation = Callable[Concatenate[Manners, P], Talk[T]]

DEFAULT_URL = "http://127.0.0.1:8080"


def _resume(talk: Talk[T], value: Any, error: httpx.TransportError | None) -> Step:
    """Goes on with a conversation after a step, up to the next one; raises `StopIteration` at its end."""
    return talk.throw(error) if error else talk.send(value)


class _Carrier:
    """Carries out the steps of one conversation."""

    def __init__(self, client: Client) -> None:
        self.http = client.http
        self.separate = client.separate
        self.stream: tuple[httpx.Client, httpx.Response] | None = None
        self.pieces: Iterator[bytes] = iter(())

    def perform(self, step: Step) -> tuple[Any, httpx.TransportError | None]:
        try:
            if isinstance(step, Pause):
                time.sleep(step.seconds)
                return None, None
            if isinstance(step, More):
                return next((piece for piece in self.pieces if piece), b""), None
            if isinstance(step, Open):
                return self._open(step.call), None
            return (self._call(step), None) if isinstance(step, Call) else (None, None)
        except httpx.TransportError as error:
            return None, error

    def _call(self, call: Call) -> Answer:
        response = self.http.send(_request(self.http, call), stream=True)
        try:
            sink = call.into(_head(response)) if call.into else None
            if sink is None:
                return _head(response, response.read())
            for piece in response.iter_bytes():
                sink.write(piece)
            return _head(response)
        finally:
            response.close()

    def _open(self, call: Call) -> Answer:
        self.close()
        # Connections of its own: the garbage collector closes an iterator that is left behind at any moment, also
        # in the midst of another call, which holds the lock of its connections.
        http = self.separate()
        response = http.send(_request(http, call), stream=True)
        self.stream = (http, response)
        if response.status_code >= 400:
            return _head(response, response.read())
        self.pieces = response.iter_bytes()
        return _head(response)

    def close(self) -> None:
        if self.stream is not None:
            http, response = self.stream
            response.close()
            http.close()


class _AsyncCarrier:
    """The same without blocking."""

    def __init__(self, http: httpx.AsyncClient) -> None:
        self.http = http
        self.stream: httpx.Response | None = None
        self.pieces: AsyncIterator[bytes]

    async def perform(self, step: Step) -> tuple[Any, httpx.TransportError | None]:
        try:
            if isinstance(step, Pause):
                await asyncio.sleep(step.seconds)
                return None, None
            if isinstance(step, More):
                async for piece in self.pieces:
                    if piece:
                        return piece, None
                return b"", None
            if isinstance(step, Open):
                return await self._open(step.call), None
            return (await self._call(step), None) if isinstance(step, Call) else (None, None)
        except httpx.TransportError as error:
            return None, error

    async def _call(self, call: Call) -> Answer:
        response = await self.http.send(_request(self.http, call), stream=True)
        try:
            sink = call.into(_head(response)) if call.into else None
            if sink is None:
                return _head(response, await response.aread())
            async for piece in response.aiter_bytes():
                sink.write(piece)
            return _head(response)
        finally:
            await response.aclose()

    async def _open(self, call: Call) -> Answer:
        await self.close()
        self.stream = await self.http.send(_request(self.http, call), stream=True)
        if self.stream.status_code >= 400:
            return _head(self.stream, await self.stream.aread())
        self.pieces = self.stream.aiter_bytes()
        return _head(self.stream)

    async def close(self) -> None:
        if self.stream is not None:
            await self.stream.aclose()


def _request(http: httpx.Client | httpx.AsyncClient, call: Call) -> httpx.Request:
    content = {"json": call.json} if call.json is not None else {"content": call.content}
    timeout = httpx.Timeout(call.timeout_s, connect=10.0)
    parts: dict[str, Any] = {"params": call.params, "headers": call.headers, "timeout": timeout, **content}
    return http.build_request(call.method, call.path, **parts)


def _head(response: httpx.Response, body: bytes = b"") -> Answer:
    return Answer(response.status_code, response.headers, body)


def _dressed(method: M, operation: Callable[..., Any]) -> M:
    """With the name, the docstring and the signature of the operation."""
    functools.update_wrapper(method, operation)
    signature = inspect.signature(operation)
    first, *others = signature.parameters.values()
    myself = first.replace(name="self", annotation=inspect.Parameter.empty)
    made = re.sub(r"^Talk\[(.*)\]$", r"\1", str(signature.return_annotation))
    method.__dict__["__signature__"] = signature.replace(parameters=[myself, *others], return_annotation=made)
    return method


def _blocking(operation: Operation[P, T]) -> Callable[Concatenate[Client, P], T]:
    def method(client: Client, /, *args: P.args, **options: P.kwargs) -> T:
        talk, carrier = operation(client.manners, *args, **options), _Carrier(client)
        try:
            step = next(talk)
            while True:
                step = _resume(talk, *carrier.perform(step))
        except StopIteration as end:
            made: T = end.value
            return made

    return _dressed(method, operation)


def _iterated(operation: Operation[P, None], kind: type[T]) -> Callable[Concatenate[Client, P], Iterator[T]]:
    def method(client: Client, /, *args: P.args, **options: P.kwargs) -> Iterator[T]:
        talk, carrier = operation(client.manners, *args, **options), _Carrier(client)
        try:
            step = next(talk)
            while True:
                if isinstance(step, Give):
                    yield step.item
                step = _resume(talk, *carrier.perform(step))
        except StopIteration:
            return
        finally:
            carrier.close()

    return _dressed(method, operation)


def _awaited(operation: Operation[P, T]) -> Callable[Concatenate[AsyncClient, P], Coroutine[Any, Any, T]]:
    async def method(client: AsyncClient, /, *args: P.args, **options: P.kwargs) -> T:
        talk, carrier = operation(client.manners, *args, **options), _AsyncCarrier(client.http)
        try:
            step = next(talk)
            while True:
                step = _resume(talk, *await carrier.perform(step))
        except StopIteration as end:
            made: T = end.value
            return made

    return _dressed(method, operation)


def _iterated_async(
    operation: Operation[P, None], kind: type[T]
) -> Callable[Concatenate[AsyncClient, P], AsyncIterator[T]]:
    async def method(client: AsyncClient, /, *args: P.args, **options: P.kwargs) -> AsyncIterator[T]:
        talk, carrier = operation(client.manners, *args, **options), _AsyncCarrier(client.http)
        try:
            step = next(talk)
            while True:
                if isinstance(step, Give):
                    yield step.item
                step = _resume(talk, *await carrier.perform(step))
        except StopIteration:
            return
        finally:
            await carrier.close()

    return _dressed(method, operation)


def _settings(url: str, api_key: str | None, headers: Mapping[str, str] | None) -> dict[str, Any]:
    api_key = os.environ.get("GRIDFALL_API_KEY") if api_key is None else api_key
    shown = {"authorization": f"Bearer {api_key}"} if api_key else {}
    # Proxies of the environment lead away from this machine.
    local = urlsplit(url).hostname in ("127.0.0.1", "localhost", "::1")
    return {"base_url": url.rstrip("/"), "headers": {**shown, **(headers or {})}, "trust_env": not local}


class Client:
    """A server, by its address. Calls return when they are done; `AsyncClient` has the same ones to be awaited.

    - api_key: the key that the server asks for; otherwise that of `GRIDFALL_API_KEY`, if there is one.
    - retries: how often a call is repeated when the connection breaks or the server asks for patience.
    - headers: sent with every call.
    - transport: another one of httpx.
    """

    def __init__(
        self,
        url: str = DEFAULT_URL,
        *,
        api_key: str | None = None,
        retries: int = 6,
        headers: Mapping[str, str] | None = None,
        transport: httpx.BaseTransport | None = None,
    ) -> None:
        self.url = url
        self.manners = Manners(retries)
        self.separate = functools.partial(httpx.Client, transport=transport, **_settings(url, api_key, headers))
        self.http = self.separate()

    def close(self) -> None:
        """Closes the connections."""
        self.http.close()

    def __enter__(self) -> Client:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"Client({self.url!r})"

    run = _blocking(operations.run)
    submit = _blocking(operations.submit)
    validate = _blocking(operations.validate)
    element_test = _blocking(operations.element_test)
    job = _blocking(operations.job)
    jobs = _iterated(operations.jobs, Job)
    wait = _blocking(operations.wait)
    watch = _iterated(operations.watch, Job)
    result = _blocking(operations.result)
    cancel = _blocking(operations.cancel)
    rerun = _blocking(operations.rerun)
    delete = _blocking(operations.delete)
    cancel_jobs = _blocking(operations.cancel_jobs)
    delete_jobs = _blocking(operations.delete_jobs)
    sweep = _blocking(of_sweeps.sweep)
    validate_sweep = _blocking(of_sweeps.validate_sweep)
    sweeps = _iterated(of_sweeps.sweeps, Sweep)
    run_sweep = _blocking(of_sweeps.run_sweep)
    wait_sweep = _blocking(of_sweeps.wait_sweep)
    sweep_jobs = _blocking(of_sweeps.sweep_jobs)
    sweep_results = _blocking(of_sweeps.sweep_results)
    cancel_sweep = _blocking(of_sweeps.cancel_sweep)
    recording = _blocking(outputs.recording)
    follow = _iterated(outputs.follow, Frame)
    frame_list = _blocking(outputs.frame_list)
    diagnostics = _blocking(outputs.diagnostics)
    solver = _blocking(outputs.solver)
    links = _blocking(outputs.links)
    log = _blocking(outputs.log)
    thumbnail = _blocking(outputs.thumbnail)
    picture = _blocking(outputs.picture)
    surface = _blocking(outputs.surface)
    export = _blocking(outputs.export)
    points = _blocking(outputs.points)
    state = _blocking(outputs.state)
    job_scene = _blocking(outputs.job_scene)
    keep_scene = _blocking(operations.keep_scene)
    kept_scenes = _blocking(operations.kept_scenes)
    kept_scene = _blocking(operations.kept_scene)
    upload = _blocking(operations.upload)
    assets = _blocking(operations.assets)
    materials = _blocking(operations.materials)
    library = _blocking(operations.library)
    library_scene = _blocking(operations.library_scene)
    webhooks = _blocking(of_webhooks.webhooks)
    add_webhook = _blocking(of_webhooks.add_webhook)
    webhook = _blocking(of_webhooks.webhook)
    delete_webhook = _blocking(of_webhooks.delete_webhook)
    test_webhook = _blocking(of_webhooks.test_webhook)
    deliveries = _iterated(of_webhooks.deliveries, Delivery)
    retry_delivery = _blocking(of_webhooks.retry_delivery)
    devices = _blocking(operations.devices)
    ready = _blocking(operations.ready)


class AsyncClient:
    """A server, by its address, for asyncio: the methods of `Client`, to be awaited."""

    def __init__(
        self,
        url: str = DEFAULT_URL,
        *,
        api_key: str | None = None,
        retries: int = 6,
        headers: Mapping[str, str] | None = None,
        transport: httpx.AsyncBaseTransport | None = None,
    ) -> None:
        self.url = url
        self.manners = Manners(retries)
        self.http = httpx.AsyncClient(transport=transport, **_settings(url, api_key, headers))

    async def close(self) -> None:
        """Closes the connections."""
        await self.http.aclose()

    async def __aenter__(self) -> AsyncClient:
        return self

    async def __aexit__(self, *_: object) -> None:
        await self.close()

    def __repr__(self) -> str:
        return f"AsyncClient({self.url!r})"

    run = _awaited(operations.run)
    submit = _awaited(operations.submit)
    validate = _awaited(operations.validate)
    element_test = _awaited(operations.element_test)
    job = _awaited(operations.job)
    jobs = _iterated_async(operations.jobs, Job)
    wait = _awaited(operations.wait)
    watch = _iterated_async(operations.watch, Job)
    result = _awaited(operations.result)
    cancel = _awaited(operations.cancel)
    rerun = _awaited(operations.rerun)
    delete = _awaited(operations.delete)
    cancel_jobs = _awaited(operations.cancel_jobs)
    delete_jobs = _awaited(operations.delete_jobs)
    sweep = _awaited(of_sweeps.sweep)
    validate_sweep = _awaited(of_sweeps.validate_sweep)
    sweeps = _iterated_async(of_sweeps.sweeps, Sweep)
    run_sweep = _awaited(of_sweeps.run_sweep)
    wait_sweep = _awaited(of_sweeps.wait_sweep)
    sweep_jobs = _awaited(of_sweeps.sweep_jobs)
    sweep_results = _awaited(of_sweeps.sweep_results)
    cancel_sweep = _awaited(of_sweeps.cancel_sweep)
    recording = _awaited(outputs.recording)
    follow = _iterated_async(outputs.follow, Frame)
    frame_list = _awaited(outputs.frame_list)
    diagnostics = _awaited(outputs.diagnostics)
    solver = _awaited(outputs.solver)
    links = _awaited(outputs.links)
    log = _awaited(outputs.log)
    thumbnail = _awaited(outputs.thumbnail)
    picture = _awaited(outputs.picture)
    surface = _awaited(outputs.surface)
    export = _awaited(outputs.export)
    points = _awaited(outputs.points)
    state = _awaited(outputs.state)
    job_scene = _awaited(outputs.job_scene)
    keep_scene = _awaited(operations.keep_scene)
    kept_scenes = _awaited(operations.kept_scenes)
    kept_scene = _awaited(operations.kept_scene)
    upload = _awaited(operations.upload)
    assets = _awaited(operations.assets)
    materials = _awaited(operations.materials)
    library = _awaited(operations.library)
    library_scene = _awaited(operations.library_scene)
    webhooks = _awaited(of_webhooks.webhooks)
    add_webhook = _awaited(of_webhooks.add_webhook)
    webhook = _awaited(of_webhooks.webhook)
    delete_webhook = _awaited(of_webhooks.delete_webhook)
    test_webhook = _awaited(of_webhooks.test_webhook)
    deliveries = _iterated_async(of_webhooks.deliveries, Delivery)
    retry_delivery = _awaited(of_webhooks.retry_delivery)
    devices = _awaited(operations.devices)
    ready = _awaited(operations.ready)
