"""A small web server: the page, and the events of a running match."""

from __future__ import annotations

import contextlib
import ipaddress
import queue
import socket
import sys
import threading
import time
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

from keepaway_sim.errors import KeepawayError
from keepaway_sim.view.live import Event, LiveMatch
from keepaway_sim.view.page import page

MAX_BROWSERS = 16  # that watch
MAX_CONNECTIONS = 64  # at once, each with a thread; more are closed unread
QUEUE_SIZE = 400  # events that a slow browser may be behind
KEEP_ALIVE = 5.0  # [s] a sign of life, by which browsers that are gone are noticed
REQUEST_TIMEOUT = 10.0  # [s] for all of a request to come, and for an event to be taken
EVERYWHERE = "0.0.0.0"
HTTP_PORT = 80  # browsers leave it out of a host's name


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

        self._http = _HttpServer((host, port), Handler)
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
        own, own_port = self.address
        if own_port == HTTP_PORT and not host.endswith(f":{HTTP_PORT}"):
            host += f":{HTTP_PORT}"
        name, _, port = host.lower().rpartition(":")
        if port != str(own_port):
            return False
        if name in ("127.0.0.1", "localhost", own):
            return True
        return own == EVERYWHERE and (name == socket.gethostname().lower() or _is_number(name))

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
                if event[0] == "match":  # events before it are of another match
                    with events.mutex:
                        events.queue.clear()
                with contextlib.suppress(queue.Full):
                    events.put_nowait(event)


def _is_number(name: str) -> bool:
    try:
        ipaddress.ip_address(name.strip("[]"))
    except ValueError:
        return False
    return True


class _HttpServer(ThreadingHTTPServer):
    """A thread for each of at most N connections, and none for long without a request."""

    daemon_threads = True
    request_queue_size = MAX_CONNECTIONS

    def __init__(self, address: tuple[str, int], handler: type[BaseHTTPRequestHandler]) -> None:
        self._lock = threading.Lock()
        self._asking: dict[socket.socket, float] = {}  # connections: when they came [s]
        self._open: set[socket.socket] = set()
        super().__init__(address, handler)

    def process_request(self, request: Any, client_address: Any) -> None:
        """Let a thread answer, if there are not too many."""
        with self._lock:
            if is_free := len(self._open) < MAX_CONNECTIONS:
                self._open.add(request)
                self._asking[request] = time.monotonic()
        if is_free:
            super().process_request(request, client_address)
        else:
            super().shutdown_request(request)

    def has_asked(self, request: Any) -> None:
        """A request has come whole."""
        with self._lock:
            self._asking.pop(request, None)

    def shutdown_request(self, request: Any) -> None:
        """A connection has ended."""
        with self._lock:
            self._open.discard(request)
            self._asking.pop(request, None)
        super().shutdown_request(request)

    def service_actions(self) -> None:
        """Several times a second: end connections whose request does not come, byte by byte."""
        latest = time.monotonic() - REQUEST_TIMEOUT
        with self._lock:
            for request in [each for each, came in self._asking.items() if came < latest]:
                del self._asking[request]
                with contextlib.suppress(OSError):
                    request.shutdown(socket.SHUT_RDWR)  # its thread reads the end, and closes it

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Say nothing of a browser that has gone; anything else is an error of ours."""
        if not isinstance(sys.exception(), OSError):
            super().handle_error(request, client_address)


class _Handler(BaseHTTPRequestHandler):
    """Answers one browser's requests."""

    live: Server
    server: _HttpServer
    server_version, sys_version = "keepaway", ""
    timeout = REQUEST_TIMEOUT

    def do_GET(self) -> None:
        """The page, or its events."""
        self.server.has_asked(self.connection)
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
        except OSError:  # it is gone, or has taken nothing for REQUEST_TIMEOUT
            return

    def _send_event(self, event: Event) -> None:
        kind, data = event
        self.wfile.write(f"event: {kind}\ndata: {data}\n\n".encode())
