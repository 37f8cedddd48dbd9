"""Downloads that go on where they broke off."""

from __future__ import annotations

from pathlib import Path
from typing import BinaryIO

from .exchange import Answer, Call, Manners, Talk, ask_resuming


def download(manners: Manners, source: str, target: Path) -> Talk[Path]:
    """Fetches a file. It gets its name when it is whole.

    Until then it is `NAME.part`, and `NAME.part.etag` says of which version it is, so that another program can go on.
    """
    part, version = target.with_name(f"{target.name}.part"), target.with_name(f"{target.name}.part.etag")
    with part.open("ab") as file:

        def headers() -> dict[str, str]:
            file.flush()
            so_far = part.stat().st_size
            known = version.read_text() if version.exists() else ""
            # Compressed bytes could not be counted.
            plain = {"accept-encoding": "identity"}
            # The last byte again, because there may be none after it, and no range is refused.
            return {**plain, "range": f"bytes={so_far - 1}-", "if-range": known} if so_far and known else plain

        def into(head: Answer) -> BinaryIO | None:
            if head.status == 200:
                file.truncate(0)
                version.write_text(head.headers.get("etag", ""))
            elif head.status == 206:
                file.truncate(part.stat().st_size - 1)
            return file if head.status in (200, 206) else None

        yield from ask_resuming(manners, Call("GET", source, into=into, timeout_s=120), headers)
    part.replace(target)
    version.unlink(missing_ok=True)
    return target
