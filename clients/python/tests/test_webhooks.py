"""Webhooks, with a receiver that checks signatures by the library of Standard Webhooks."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from http.server import BaseHTTPRequestHandler, HTTPServer
from typing import Any

import pytest
from standardwebhooks.webhooks import Webhook

import gridfall


class Receiver(HTTPServer):
    status = 204

    def __init__(self) -> None:
        super().__init__(("127.0.0.1", 0), Handler)
        self.received: list[tuple[dict[str, str], bytes]] = []
        self.url = f"http://127.0.0.1:{self.server_port}/"


class Handler(BaseHTTPRequestHandler):
    server: Receiver

    def do_POST(self) -> None:
        body = self.rfile.read(int(self.headers["content-length"]))
        self.server.received.append((dict(self.headers.items()), body))
        self.send_response(self.server.status)
        self.end_headers()

    def log_message(self, *_: object) -> None:
        pass


@pytest.fixture
def receiver() -> Iterator[Receiver]:
    with Receiver() as receiver:
        thread = threading.Thread(target=receiver.serve_forever)
        thread.start()
        yield receiver
        receiver.shutdown()
        thread.join()


def until(wanted: Callable[[], Any]) -> Any:
    for _ in range(600):
        if found := wanted():
            return found
        time.sleep(0.05)
    raise AssertionError("it never came")


def test_what_happens_is_told(client: gridfall.Client, square: gridfall.Scene, receiver: Receiver) -> None:
    webhook = client.add_webhook(receiver.url, events=["job.succeeded"])
    assert client.webhook(webhook).enabled and webhook.id in [each.id for each in client.webhooks()]
    job = client.wait(client.submit(square))
    until(lambda: receiver.received)
    headers, body = receiver.received[0]
    event = Webhook(webhook.secret).verify(body, headers)
    assert event["type"] == "job.succeeded" and gridfall.Job.from_dict(event["data"]) == job
    delivered = until(lambda: [each for each in client.deliveries(webhook) if each.status == "delivered"])
    assert delivered[0].payload == event and delivered[0].answer.status == 204
    client.delete_webhook(webhook)
    with pytest.raises(gridfall.NotFound):
        client.webhook(webhook)


def test_what_was_given_up_is_sent_again(client: gridfall.Client, receiver: Receiver) -> None:
    webhook = client.add_webhook(receiver.url)
    receiver.status = 500
    sent = client.test_webhook(webhook)
    dead = until(lambda: list(client.deliveries(webhook, status="dead", page=1)))
    assert [each.id for each in dead] == [sent.id] and dead[0].event == "webhook.test"
    receiver.status = 200
    client.retry_delivery(webhook, dead[0])
    until(lambda: not list(client.deliveries(webhook, status="dead")) and len(receiver.received) == 2)
    client.delete_webhook(webhook)
    with pytest.raises(gridfall.ApiError, match="--allow-webhook-address"):
        client.add_webhook("http://10.0.0.1/")
