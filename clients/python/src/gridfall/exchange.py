"""Conversations with a server, free of sockets: generators that ask for calls and pauses, and get answers.

`Client` and `AsyncClient` carry the same conversations out, one blocking and the other not.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Generator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, BinaryIO, TypeVar

import httpx

from .errors import ServerUnreachable, refusal

T = TypeVar("T")


@dataclass(frozen=True)
class Answer:
    """What came back. The body is empty if it went into a file."""

    status: int
    headers: Mapping[str, str]
    body: bytes


@dataclass(frozen=True)
class Call:
    """A request."""

    method: str
    path: str
    params: Mapping[str, str] = field(default_factory=dict)
    headers: Mapping[str, str] = field(default_factory=dict)
    json: Any = None
    content: bytes | None = None
    into: Callable[[Answer], BinaryIO | None] | None = None
    """Takes the head of the answer and says where its body goes."""
    repeatable: bool = True
    """Whether sending it twice does what sending it once does."""
    timeout_s: float = 60.0
    """How long nothing may come."""


@dataclass(frozen=True)
class Pause:
    """Time to let pass."""

    seconds: float


@dataclass(frozen=True)
class Open:
    """A call whose body comes piece by piece, as the answers to `More`; `Answer` is its head."""

    call: Call


@dataclass(frozen=True)
class More:
    """Asks for the next piece of what is open. Empty at the end."""


@dataclass(frozen=True)
class Give:
    """An item of a conversation that makes many."""

    item: Any


Step = Call | Pause | Open | More | Give
Talk = Generator[Step, Any, T]


@dataclass(frozen=True)
class Manners:
    """How often a call is repeated, and after which pauses."""

    retries: int = 6
    first_pause_s: float = 0.2
    longest_pause_s: float = 10.0

    def pause(self, attempt: int, answer: Answer | None = None) -> Pause:
        """As long as the server asks for; otherwise twice as long each time, and not in step with other clients."""
        wanted = answer.headers.get("retry-after", "") if answer else ""
        if wanted.isdigit():
            return Pause(min(float(wanted), 60.0))
        longest = min(self.first_pause_s * 2.0**attempt, self.longest_pause_s)
        return Pause(longest * random.uniform(0.5, 1.0))


def ask(manners: Manners, call: Call) -> Talk[Answer]:
    """Makes a call, repeats it where that is safe and may help, and raises what the server says of errors."""
    answer: Answer = yield from _patiently(manners, call, lambda: call)
    return answer


def open_stream(manners: Manners, call: Call) -> Talk[Answer]:
    """The same for a call whose body comes piece by piece."""
    answer: Answer = yield from _patiently(manners, call, lambda: Open(call))
    return answer


def ask_resuming(manners: Manners, call: Call, headers: Callable[[], Mapping[str, str]]) -> Talk[Answer]:
    """The same for a call with headers that depend on what came so far."""
    answer: Answer = yield from _patiently(manners, call, lambda: replace(call, headers={**call.headers, **headers()}))
    return answer


def _patiently(manners: Manners, call: Call, step: Callable[[], Call | Open]) -> Talk[Answer]:
    for attempt in range(manners.retries + 1):
        last = attempt == manners.retries
        try:
            answer: Answer = yield step()
        except httpx.TransportError as error:
            # A request that was not sent did nothing.
            unsent = isinstance(error, (httpx.ConnectError, httpx.ConnectTimeout, httpx.PoolTimeout))
            if last or not (call.repeatable or unsent):
                raise ServerUnreachable(_said(call, error)) from error
            yield manners.pause(attempt)
            continue
        if answer.status in (429, 503) and not last:
            yield manners.pause(attempt, answer)
        elif answer.status >= 400:
            raise refusal(answer.status, answer.body)
        else:
            return answer
    raise AssertionError("the last attempt returns or raises")


def _said(call: Call, error: httpx.TransportError) -> str:
    what = str(error) or type(error).__name__
    doubt = "" if call.repeatable else "; it may have been accepted, so look before you send it again"
    return f"{call.method} {call.path}: {what}{doubt}"


def collected(talk: Talk[None]) -> Talk[list[Any]]:
    """All items of a conversation that makes many."""
    items = []
    try:
        step = next(talk)
        while True:
            if isinstance(step, Give):
                items.append(step.item)
                step = next(talk)
                continue
            try:
                answer = yield step
            except httpx.TransportError as error:
                step = talk.throw(error)
            else:
                step = talk.send(answer)
    except StopIteration:
        return items
