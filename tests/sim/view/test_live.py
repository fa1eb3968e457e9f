"""A live match in the browser: it is followed, and the server speaks to its own page only."""

import http.client
import json
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import browser as chromium
import numpy as np
import pytest

from keepaway_sim.bags.match_bag import MatchBag
from keepaway_sim.bags.reader import BagReader
from keepaway_sim.view import live
from keepaway_sim.view import server as serving
from keepaway_sim.view.live import Event, LiveMatch
from keepaway_sim.view.page import encoded, frames
from keepaway_sim.view.server import Server
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
