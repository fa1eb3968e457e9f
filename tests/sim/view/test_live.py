"""A live match in the browser: it is followed, and the server speaks to its own page only."""

import contextlib
import http.client
import json
import math
import socket
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import browser as chromium
import numpy as np
import pytest

from keepaway_sim.bags.match_bag import MatchBag
from keepaway_sim.bags.reader import BagReader
from keepaway_sim.errors import KeepawayError
from keepaway_sim.view import live
from keepaway_sim.view import server as serving
from keepaway_sim.view.live import Event, LiveMatch
from keepaway_sim.view.page import encoded, frames, page
from keepaway_sim.view.server import Server
from keepaway_sim.wire.cdr import codec
from keepaway_sim.wire.messages import MATCH


@pytest.fixture
def server() -> Iterator[Server]:
    made = Server()
    yield made
    made.close()


def ask(
    server: Server, path: str = "/", method: str = "GET", **headers: str
) -> tuple[int, str, dict[str, str]]:
    connection = http.client.HTTPConnection(*server.address, timeout=10)
    connection.request(method, path, headers=headers)
    answer = connection.getresponse()
    text = "" if answer.getheader("Content-Type", "").startswith("text/event") else answer.read()
    connection.close()
    return answer.status, str(text), dict(answer.getheaders())


def events_of(bag: Path, monkeypatch: pytest.MonkeyPatch) -> list[Event]:
    """What a bag's messages become, no cycle left out."""
    monkeypatch.setattr(live, "FRAME_PERIOD", 0.0)
    sent: list[Event] = []
    match = LiveMatch(sent.append)
    for message in BagReader(bag).messages():
        if message.topic != "/clock":
            match.feed(message.message_type, message.data)
            match.show()
    return sent


def test_a_live_match_is_told_as_its_recording_is(
    bag_3v2: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    sent = events_of(bag_3v2, monkeypatch)
    bag = MatchBag(bag_3v2)
    assert sent[0][0] == "match"
    told = [json.loads(data) for kind, data in sent if kind == "frame"]
    for episode in bag.episodes():
        rows = frames(bag.track(episode), bag.task)
        assert [text for number, text in told if number == episode.number] == [
            encoded(row) for row in rows
        ]
    ended = [json.loads(data) for kind, data in sent if kind == "episode"]
    assert [entry["duration"] for entry in ended] == [
        round(episode.duration, 3) for episode in bag.episodes()
    ]


def test_browsers_are_not_sent_more_moments_than_they_show(bag_3v2: Path) -> None:
    sent: list[Event] = []
    match = LiveMatch(sent.append)
    started = time.monotonic()
    for message in BagReader(bag_3v2).messages():
        if message.topic != "/clock":
            match.feed(message.message_type, message.data)
            match.show()
    took = time.monotonic() - started
    count = sum(kind == "frame" for kind, _ in sent)
    assert 4 <= count <= took / live.FRAME_PERIOD + 2 * 4


def test_a_new_match_begins_anew(bag_3v2: Path) -> None:
    sent: list[Event] = []
    match = LiveMatch(sent.append)
    said = list(BagReader(bag_3v2).messages())
    for message in [*said, *(m for m in said if m.message_type == MATCH)]:
        if message.topic != "/clock":
            match.feed(message.message_type, message.data)
            match.show()
    assert [kind for kind, _ in match.history] == ["match"]


def test_messages_of_another_match_on_the_same_topics_are_not_shown(
    bag_3v2: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(live, "FRAME_PERIOD", 0.0)
    own: list[Event] = []
    both: list[Event] = []
    own_match, mixed = LiveMatch(own.append), LiveMatch(both.append)
    for message in BagReader(bag_3v2).messages():
        if message.topic == "/clock":
            continue
        layout = codec(message.message_type)
        said = layout.decode(message.data)
        data = layout.encode({**said, "match_id": 7})
        for match in (own_match, mixed):
            match.feed(message.message_type, data)
        if message.message_type != MATCH:
            mixed.feed(message.message_type, layout.encode({**said, "match_id": 8}))
        own_match.show()
        mixed.show()
    assert both == own


def test_it_listens_to_this_machine_only(server: Server) -> None:
    assert server.address[0] == "127.0.0.1"
    assert server.url == f"http://127.0.0.1:{server.address[1]}/"


def test_the_page_is_served_and_may_load_nothing_else(server: Server) -> None:
    status, text, headers = ask(server)
    assert status == 200
    assert '"live":true' in text
    assert headers["Content-Security-Policy"].startswith("default-src 'none'")


@pytest.mark.parametrize(
    "headers",
    [
        {"Host": "evil.example"},
        {"Host": "evil.example:{port}"},
        {"Host": "127.0.0.1"},
        {"Origin": "http://evil.example"},
        {"Origin": "null"},
        {"Origin": "http://127.0.0.1:1"},
    ],
)
@pytest.mark.parametrize("path", ["/", "/events"])
def test_other_sites_are_refused(server: Server, path: str, headers: dict[str, str]) -> None:
    named = {name: value.format(port=server.address[1]) for name, value in headers.items()}
    assert ask(server, path, **named)[0] == 403


def test_in_a_network_it_is_known_by_number_and_not_by_any_name() -> None:
    server = Server("0.0.0.0")
    port = server.address[1]
    try:
        assert server.may_be_named(f"192.168.1.7:{port}")
        assert server.may_be_named(f"localhost:{port}")
        assert not server.may_be_named(f"evil.example:{port}")
        assert not server.may_be_named("192.168.1.7:1")
    finally:
        server.close()


def test_a_browser_leaves_port_80_out_of_the_name(server: Server) -> None:
    server.address = ("127.0.0.1", 80)
    for name in ("localhost", "127.0.0.1", "localhost:80", "LocalHost"):
        assert server.may_be_named(name)
    for name in ("evil.example", "evil.example:80", "localhost:81", "", ":80"):
        assert not server.may_be_named(name)
    server.address = ("127.0.0.1", 8000)
    assert not server.may_be_named("localhost")


def connected(server: Server) -> socket.socket:
    return socket.create_connection(server.address, timeout=30)


def test_a_request_that_does_not_come_is_not_waited_for(
    server: Server, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(serving, "REQUEST_TIMEOUT", 1.0)
    with connected(server) as silent, connected(server) as slow:
        ended = threading.Event()

        def send_byte_by_byte() -> None:
            with contextlib.suppress(OSError):
                while True:
                    slow.send(b"G")
                    ended.wait(0.05)

        sender = threading.Thread(target=send_byte_by_byte, daemon=True)
        sender.start()
        assert silent.recv(1) == b""
        with contextlib.suppress(ConnectionResetError):
            assert slow.recv(1) == b""
        ended.set()
        sender.join()


def test_connections_are_bounded_and_free_again(
    server: Server, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(serving, "MAX_CONNECTIONS", 3)
    threads = threading.active_count()
    with contextlib.ExitStack() as stack:
        held = [stack.enter_context(connected(server)) for _ in range(3)]
        more = [stack.enter_context(connected(server)) for _ in range(20)]
        for one in more:
            with contextlib.suppress(ConnectionResetError):
                assert one.recv(1) == b""
        assert threading.active_count() <= threads + 3
        for one in held:
            one.send(f"GET / HTTP/1.0\r\nHost: 127.0.0.1:{server.address[1]}\r\n\r\n".encode())
            assert one.recv(12) == b"HTTP/1.0 200"
    while threading.active_count() > threads:
        threading.Event().wait(0.01)
    assert ask(server)[0] == 200


def test_a_browser_that_takes_nothing_is_given_up(
    server: Server, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(serving._Handler, "timeout", 1.0)
    with connected(server) as deaf:
        host = f"127.0.0.1:{server.address[1]}"
        deaf.send(f"GET /events HTTP/1.0\r\nHost: {host}\r\n\r\n".encode())
        while not server._browsers:
            threading.Event().wait(0.01)
        while server._browsers:
            server._broadcast(("frame", json.dumps("x" * 100_000)))
            threading.Event().wait(0.01)


def test_what_a_match_says_is_text_in_a_page_and_no_markup() -> None:
    hostile = "</script></title><img src=x onerror=alert(1)>\x1b[31m"
    text = page({"live": False, "match": {"task": hostile, "facts": [hostile]}, "episodes": []})
    assert "<img" not in text
    assert "\x1b" not in text.partition("</title>")[2]


def test_a_match_with_names_that_are_none_is_refused(bag_3v2: Path) -> None:
    first = next(m for m in BagReader(bag_3v2).messages() if m.message_type == MATCH)
    values = codec(MATCH).decode(first.data)
    match = LiveMatch(lambda _: None)
    for changes in (
        {"player_names": ["<b>", *values["player_names"][1:]]},
        {"player_names": ["keeper_1\x1b[31m", *values["player_names"][1:]]},
        {"player_names": ["a" * 1000, *values["player_names"][1:]]},
        {"player_names": values["player_names"] * 100},
        {"visible_angle": math.nan},
        {"num_keepers": 200},
        {"field_length": math.inf},
    ):
        with pytest.raises(KeepawayError, match="makes no sense here"):
            match.feed(MATCH, codec(MATCH).encode({**values, **changes}))
    assert match.history == []
    assert match.feed(MATCH, first.data) == values["player_names"]


def test_nothing_else_is_there_and_nothing_can_be_sent(server: Server) -> None:
    assert ask(server, "/../etc/passwd")[0] == 404
    assert ask(server, "/events?x")[0] == 404
    for method in ("POST", "PUT", "DELETE"):
        assert ask(server, "/", method)[0] == 501


def test_too_many_browsers_are_refused(server: Server, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(serving, "MAX_BROWSERS", 1)
    with server.browser():
        assert ask(server, "/events")[0] == 503


def test_a_browser_that_does_not_read_costs_nothing(server: Server, bag_3v2: Path) -> None:
    message = next(BagReader(bag_3v2).messages())
    with server.browser() as events:
        for _ in range(3):
            server.match.feed(message.message_type, message.data)
        assert events.qsize() == 1
        for _ in range(2 * serving.QUEUE_SIZE):
            server._broadcast(("frame", "[]"))
        assert events.qsize() == serving.QUEUE_SIZE


@pytest.mark.skipif(chromium.find() is None, reason=chromium.INSTALL)
@pytest.mark.xdist_group("browser")
def test_a_browser_follows_the_match(server: Server, bag_3v2: Path) -> None:
    messages = [m for m in BagReader(bag_3v2).messages() if m.topic != "/clock"]
    second = list(MatchBag(bag_3v2).episodes())[1]
    gate = threading.Event()

    def play() -> None:
        for message in messages:
            if message.log_time == second.start + 2_000_000_000 and not gate.is_set():
                gate.wait(60)
            server.match.feed(message.message_type, message.data)
            server.match.show()
            time.sleep(0.001)

    program = chromium.find()
    assert program
    with chromium.browser(program) as window:
        window.open(server.url, 1280, 800)
        assert "waiting for a match" in window.value("document.title + $('title').textContent")
        player = threading.Thread(target=play, daemon=True)
        player.start()
        window.wait("document.getElementById('view').dataset.episode === '1'")
        assert window.value("$('live').getAttribute('aria-pressed')") == "true"
        row = window.value("document.querySelector('.episode').textContent")
        first = next(MatchBag(bag_3v2).episodes())
        assert f"{first.duration:.1f} s" in row
        window.press("ArrowLeft")  # looks back, and does not follow any more
        assert window.value("$('live').getAttribute('aria-pressed')") == "false"
        gate.set()
        player.join()
        window.wait("episodes.length === 4 && episodes[3].outcome > 0")
        assert window.value("document.getElementById('view').dataset.episode") == "1"
        window.click("#live")
        assert window.value("document.getElementById('view').dataset.episode") == "3"
        track = MatchBag(bag_3v2).track(list(MatchBag(bag_3v2).episodes())[3])
        ball = window.value("place(ballIndex())")
        np.testing.assert_allclose(ball, track.position[-1, 5], atol=0.01)
        window.open(server.url, 390, 844)  # one that comes late knows what was before
        window.wait("episodes.length === 4")
        assert window.complaints == []
        assert all(url.startswith((server.url, "data:")) for url in window.requests)
