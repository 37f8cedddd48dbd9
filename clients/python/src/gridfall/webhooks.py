"""What can be asked of a server about webhooks. `Client` and `AsyncClient` have these as methods."""

from __future__ import annotations

from collections.abc import Sequence

from .exchange import Call, Give, Manners, Talk, ask
from .models import AddedWebhook, Delivery, DeliveryList, DeliveryStatus, EventType, Webhook, WebhookList
from .requests import decoded, given


def webhooks(manners: Manners) -> Talk[list[Webhook]]:
    """All webhooks, oldest first."""
    return WebhookList.from_dict(decoded((yield from ask(manners, Call("GET", "/v1/webhooks"))))).webhooks


def add_webhook(
    manners: Manners, url: str, *, events: Sequence[EventType] = (), secret: str | None = None
) -> Talk[AddedWebhook]:
    """Has the server post to an address what happens to jobs, from now on.

    The answer has the `secret` by which libraries of Standard Webhooks check messages. It is not shown again.

    - events: types to be told of, such as `job.succeeded`; all without any.
    - secret: one of your own, `whsec_` and 24 to 64 bytes in base64.
    """
    body = {"url": url, **given(events=list(events), secret=secret)}
    call = Call("POST", "/v1/webhooks", json=body, repeatable=False)
    return AddedWebhook.from_dict(decoded((yield from ask(manners, call))))


def webhook(manners: Manners, webhook: Webhook | AddedWebhook | str) -> Talk[Webhook]:
    """A webhook as it stands: `enabled` is false once its receiver answered 410."""
    return Webhook.from_dict(decoded((yield from ask(manners, Call("GET", _path(webhook))))))


def delete_webhook(manners: Manners, webhook: Webhook | AddedWebhook | str) -> Talk[None]:
    """Removes a webhook and its deliveries."""
    yield from ask(manners, Call("DELETE", _path(webhook), repeatable=False))


def test_webhook(manners: Manners, webhook: Webhook | AddedWebhook | str) -> Talk[Delivery]:
    """Has a message of the type `webhook.test` sent to a webhook."""
    call = Call("POST", f"{_path(webhook)}/test", repeatable=False)
    return Delivery.from_dict(decoded((yield from ask(manners, call))))


def deliveries(
    manners: Manners, webhook: Webhook | AddedWebhook | str, *, status: DeliveryStatus | None = None, page: int = 50
) -> Talk[None]:
    """The messages to a webhook, newest first. Pages are fetched as they are needed.

    - status: `dead` for those that were given up.
    """
    cursor: str | None = None
    while True:
        params = {"limit": str(page), **given(status=status, cursor=cursor)}
        answer = yield from ask(manners, Call("GET", f"{_path(webhook)}/deliveries", params=params))
        found = DeliveryList.from_dict(decoded(answer))
        for each in found.deliveries:
            yield Give(each)
        cursor = found.next_cursor
        if cursor is None:
            return


def retry_delivery(
    manners: Manners, webhook: Webhook | AddedWebhook | str, delivery: Delivery | str
) -> Talk[Delivery]:
    """Has a message sent again now, also one that was given up."""
    message = delivery if isinstance(delivery, str) else delivery.id
    call = Call("POST", f"{_path(webhook)}/deliveries/{message}/retry")
    return Delivery.from_dict(decoded((yield from ask(manners, call))))


def _path(webhook: Webhook | AddedWebhook | str) -> str:
    return f"/v1/webhooks/{webhook if isinstance(webhook, str) else webhook.id}"
