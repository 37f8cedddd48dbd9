"""A server of one's own: the program that came with the package, on a free port."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import sysconfig
import tempfile
import weakref
from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from threading import Event, Thread
from typing import IO

from .client import Client
from .errors import ProgramError

START_S = 60.0
"""A server that has not said its address after so long will not."""


def program() -> Path:
    """The program `gridfall`: $GRIDFALL_BINARY, the one of this package, or one on the PATH."""
    named = os.environ.get("GRIDFALL_BINARY")
    if named:
        found = shutil.which(named)
        if not found:
            raise ProgramError(f"GRIDFALL_BINARY is {named}, which is not a program; name it or unset the variable")
        return Path(found)
    schemes = [sysconfig.get_default_scheme(), sysconfig.get_preferred_scheme("user")]
    scripts = [sysconfig.get_path("scripts", scheme) for scheme in schemes]
    # The folder of the interpreter too, for environments whose scripts are said to be elsewhere.
    for folder in [*scripts, str(Path(sys.executable).parent), None]:
        found = shutil.which("gridfall", path=folder)
        if found:
            return Path(found)
    raise ProgramError(
        "there is no program `gridfall`: install a wheel that carries it, or build it (cargo build --release) and put "
        "it on the PATH or name it in GRIDFALL_BINARY; gridfall.Client(url) needs none"
    )


class _Server:
    """A running program; its log is kept for the case that it ends."""

    def __init__(self, arguments: Sequence[str], *, log: bool) -> None:
        command = [str(program()), "serve", "--listen", "127.0.0.1:0", *arguments]
        # A database of the environment is another server's.
        environment = {name: value for name, value in os.environ.items() if name != "GRIDFALL_DATABASE"}
        pipe = subprocess.PIPE
        self.process = subprocess.Popen(command, stdout=pipe, stderr=pipe, text=True, env=environment)
        self.log: deque[str] = deque(maxlen=20)
        self.url: str | None = None
        self.told = Event()
        self.readers = [Thread(target=self._listen, daemon=True), Thread(target=self._note, args=[log], daemon=True)]
        for reader in self.readers:
            reader.start()

    def _listen(self) -> None:
        for line in _lines(self.process.stdout):
            if found := re.match(r"listening on (\S+)", line):
                self.url = found[1]
                self.told.set()
        self.told.set()

    def _note(self, log: bool) -> None:
        for line in _lines(self.process.stderr):
            self.log.append(line)
            if log:
                sys.stderr.write(line)

    def address(self) -> str:
        self.told.wait(START_S)
        if self.url is None:
            self.stop()
            said = "".join(self.log).strip() or "it said nothing"
            raise ProgramError(f"{program()} does not start: {said}")
        return self.url

    def stop(self) -> None:
        """Ends it: a running job goes back into the queue of its data directory."""
        self.process.terminate()
        try:
            self.process.wait(30)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        for reader in self.readers:
            reader.join(5)
        for stream in (self.process.stdout, self.process.stderr):
            if stream is not None:
                stream.close()


def _lines(stream: IO[str] | None) -> Iterator[str]:
    yield from stream or ()


@contextmanager
def serve(
    *, data_dir: str | os.PathLike[str] | None = None, arguments: Sequence[str] = (), log: bool = False
) -> Iterator[str]:
    """Runs a server on a free port of this machine for as long as the context lasts, and gives its address.

    - data_dir: where jobs and recordings are kept; by default a temporary folder, which goes with the context.
    - arguments: more for `gridfall serve`, such as `["--backend", "cpu"]`.
    - log: show the server's log.
    """
    temporary = tempfile.mkdtemp(prefix="gridfall-data-") if data_dir is None else None
    try:
        server = _Server([*arguments, "--data-dir", str(temporary or data_dir)], log=log)
        try:
            yield server.address()
        finally:
            server.stop()
    finally:
        if temporary:
            shutil.rmtree(temporary, ignore_errors=True)


class LocalClient(Client):
    """A client of a server of one's own, which ends with it."""

    def __init__(self, server: AbstractContextManager[str]) -> None:
        super().__init__(server.__enter__())
        # Also at the end of the interpreter, for those who forget.
        self._end = weakref.finalize(self, server.__exit__, None, None, None)

    def close(self) -> None:
        """Closes the connections and ends the server."""
        super().close()
        self._end()


def local(
    *, data_dir: str | os.PathLike[str] | None = None, arguments: Sequence[str] = (), log: bool = False
) -> LocalClient:
    """A client of a server of one's own, which ends with `close` or with a `with`. The arguments are those of `serve`.

    >>> with gridfall.local() as g:
    ...     g.run(scene).recording.save("x.mcap")
    """
    return LocalClient(serve(data_dir=data_dir, arguments=arguments, log=log))
