"""A small web server: the page, and the events of a running match."""

from __future__ import annotations

import contextlib
import ipaddress
import queue
import socket
import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

from keepaway_sim.errors import KeepawayError
from keepaway_sim.view.live import Event, LiveMatch
from keepaway_sim.view.page import page

MAX_BROWSERS = 16
QUEUE_SIZE = 400  # events that a slow browser may be behind
KEEP_ALIVE = 5.0  # [s] a sign of life, by which browsers that are gone are noticed
EVERYWHERE = "0.0.0.0"


class Server:
    """Serves the page of a live match.

    Attributes:
        match: to be fed with messages.
        address: host and port it listens on.
    """

    def __init__(self, host: str = "127.0.0.1", port: int = 0) -> None:
        """Listen.

        Args:
            host: "127.0.0.1": this machine only; "0.0.0.0": every network it is in.
            port: 0: any that is free.

        Raises:
            OSError: the port is taken, or the host is none of this machine's.
        """
        self.match = LiveMatch(self._broadcast)
        self._browsers: list[queue.Queue[Event]] = []
        self._lock = threading.Lock()
        server = self

        class Handler(_Handler):
            live = server

        self._http = ThreadingHTTPServer((host, port), Handler)
        self._http.daemon_threads = True
        self.address: tuple[str, int] = (host, self._http.server_port)
        self._thread = threading.Thread(target=self._http.serve_forever, daemon=True)
        self._thread.start()

    @property
    def url(self) -> str:
        """Where a browser on this machine finds it."""
        host = "127.0.0.1" if self.address[0] == EVERYWHERE else self.address[0]
        return f"http://{host}:{self.address[1]}/"

    def close(self) -> None:
        """Stop listening."""
        self._http.shutdown()
        self._http.server_close()

    def may_be_named(self, host: str) -> bool:
        """Is this a name under which a browser may know this server?

        A page of another site that got its own name resolved to this machine is refused by it;
        in a network the server is known by this machine's name or by its numbers.
        """
        name, _, port = host.rpartition(":")
        if port != str(self.address[1]):
            return False
        own = self.address[0]
        if name in ("127.0.0.1", "localhost", own):
            return True
        return own == EVERYWHERE and (name == socket.gethostname() or _is_number(name))

    @contextlib.contextmanager
    def browser(self) -> Iterator[queue.Queue[Event]]:
        """The events for one more browser.

        Raises:
            KeepawayError: there are too many.
        """
        events: queue.Queue[Event] = queue.Queue(QUEUE_SIZE)
        with self._lock:
            if len(self._browsers) >= MAX_BROWSERS:
                raise KeepawayError(f"{MAX_BROWSERS} browsers are watching already")
            self._browsers.append(events)
        try:
            yield events
        finally:
            with self._lock:
                self._browsers.remove(events)

    def _broadcast(self, event: Event) -> None:
        with self._lock:
            for events in self._browsers:
                if event[0] == "match":  # whatever was before it is over
                    events.queue.clear()
                with contextlib.suppress(queue.Full):
                    events.put_nowait(event)


def _is_number(name: str) -> bool:
    try:
        ipaddress.ip_address(name.strip("[]"))
    except ValueError:
        return False
    return True


class _Handler(BaseHTTPRequestHandler):
    """Answers one browser's requests."""

    live: Server
    server_version, sys_version = "keepaway", ""

    def do_GET(self) -> None:
        """The page, or its events."""
        host, origin = self.headers.get("Host", ""), self.headers.get("Origin")
        if not self.live.may_be_named(host) or origin not in (None, f"http://{host}"):
            self.send_error(403, "This page is for its own machine's browsers")
        elif self.path == "/":
            self._send_page()
        elif self.path == "/events":
            self._send_events()
        else:
            self.send_error(404)

    def log_message(self, format: str, *args: Any) -> None:  # noqa: A002
        """Say nothing of ordinary requests."""

    def _begin(self, content_type: str) -> None:
        self.send_response(200)
        self.send_header("Content-Type", content_type)
        self.send_header("Cache-Control", "no-store")
        self.send_header("X-Content-Type-Options", "nosniff")
        self.send_header(
            "Content-Security-Policy",
            "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline';"
            " img-src data:; connect-src 'self'; frame-ancestors 'none'",
        )

    def _send_page(self) -> None:
        text = page({"live": True, "match": None, "episodes": []}).encode()
        self._begin("text/html; charset=utf-8")
        self.send_header("Content-Length", str(len(text)))
        self.end_headers()
        self.wfile.write(text)

    def _send_events(self) -> None:
        try:
            with self.live.browser() as events:
                self._begin("text/event-stream")
                self.end_headers()
                for event in self.live.match.history:
                    self._send_event(event)
                while True:
                    try:
                        self._send_event(events.get(timeout=KEEP_ALIVE))
                    except queue.Empty:
                        self.wfile.write(b": still here\n\n")
        except KeepawayError as error:
            self.send_error(503, str(error))
        except (BrokenPipeError, ConnectionError):
            return

    def _send_event(self, event: Event) -> None:
        kind, data = event
        self.wfile.write(f"event: {kind}\ndata: {data}\n\n".encode())
