"""The page in a real browser: it plays, scrubs, and shows the right episode, on any screen."""

import json
import math
from collections.abc import Iterator
from pathlib import Path

import browser as chromium
import numpy as np
import pytest
from browser import Browser

from keepaway_sim.bags.match_bag import EpisodeSummary, MatchBag, Track
from keepaway_sim.view.page import replay_page

pytestmark = [
    pytest.mark.skipif(chromium.find() is None, reason=chromium.INSTALL),
    pytest.mark.xdist_group("browser"),
]
PICTURE = "new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))"


@pytest.fixture(scope="module")
def window() -> Iterator[Browser]:
    program = chromium.find()
    assert program
    with chromium.browser(program) as window:
        yield window


@pytest.fixture(scope="module")
def bag(bag_3v2: Path) -> MatchBag:
    return MatchBag(bag_3v2)


@pytest.fixture(scope="module")
def episodes(bag: MatchBag) -> list[EpisodeSummary]:
    return list(bag.episodes())


@pytest.fixture(scope="module")
def file(bag_3v2: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("page") / "replay.html"
    made.write_text(replay_page(bag_3v2)[0], encoding="utf-8")
    return made


@pytest.fixture
def page(window: Browser, file: Path) -> Iterator[Browser]:
    """The page in a window of an ordinary size; afterwards nothing must have gone wrong."""
    window.complaints.clear()
    window.requests.clear()
    window.open(file.as_uri(), 1280, 800)
    yield window
    assert window.complaints == []
    assert {url.split(":")[0] for url in window.requests} <= {"file", "data"}


def shown(page: Browser) -> tuple[int, int]:
    """The number of the episode and the cycle that are shown."""
    said = page.value("Object.assign({}, document.getElementById('view').dataset)")
    return int(said["episode"]), int(said["cycle"])


def text(page: Browser, selector: str) -> str:
    return str(page.value(f"document.querySelector({json.dumps(selector)}).textContent"))


def test_it_begins_with_the_first_episode_and_tells_its_duration(
    page: Browser, episodes: list[EpisodeSummary]
) -> None:
    assert shown(page) == (0, 0)
    assert text(page, "#clock") == f"0.0 / {episodes[0].duration:.1f} s"
    assert text(page, "#title") == "Keepaway 3v2, 4 episodes"
    assert "seed 7" in text(page, "#facts")


def test_it_plays_and_pauses(page: Browser) -> None:
    page.click("#play")
    page.wait("Number(document.getElementById('view').dataset.cycle) >= 5", 20)
    page.click("#play")
    episode, cycle = shown(page)
    page.value(PICTURE)
    assert shown(page) == (episode, cycle)
    assert page.value("document.getElementById('view').dataset.playing") == "false"


def test_it_plays_as_fast_as_it_is_told(page: Browser) -> None:
    page.value(
        "(speed => { speed.value = 4; speed.onchange(); })(document.getElementById('speed'))"
    )
    took = page.value(
        "new Promise(done => { const start = performance.now(); setPlaying(true);"
        " const look = () => view.frame >= 20 ? done(performance.now() - start)"
        " : requestAnimationFrame(look); look(); })"
    )
    assert 450 < took < 1500  # 2 s at fourfold speed; a loaded machine draws late


def test_at_the_end_of_an_episode_it_goes_on_with_the_next(page: Browser) -> None:
    page.press("End")
    page.value("changeSpeed(9)")
    page.press(" ")
    page.press("End")
    page.wait("document.getElementById('view').dataset.episode === '1'", 20)
    page.press(" ")


def test_it_is_scrubbed_by_mouse(page: Browser, episodes: list[EpisodeSummary]) -> None:
    page.click("#scrub", across=0.5)
    episode, cycle = shown(page)
    assert episode == 0
    assert cycle == pytest.approx(episodes[0].cycles / 2, abs=2)
    page.click("#scrub", across=0.995)
    assert shown(page) == (0, episodes[0].cycles)
    assert "taken away" in text(page, "#banner") or "out of bounds" in text(page, "#banner")
    assert not page.value("document.getElementById('banner').hidden")


def test_it_is_ruled_by_keyboard(page: Browser, episodes: list[EpisodeSummary]) -> None:
    for key, shift, expected in (
        ("ArrowRight", False, (0, 1)),
        ("ArrowRight", True, (0, 11)),
        ("ArrowLeft", False, (0, 10)),
        ("ArrowLeft", True, (0, 0)),
        ("ArrowLeft", False, (0, 0)),
        ("End", False, (0, episodes[0].cycles)),
        ("ArrowDown", False, (1, 0)),
        ("ArrowDown", False, (2, 0)),
        ("ArrowUp", False, (1, 0)),
    ):
        page.press(key, shift)
        assert shown(page) == expected
    page.press("4")
    assert page.value("document.querySelectorAll('#players [aria-checked=true]')[0].title") == (
        "taker_1"
    )
    page.press("t")
    assert not page.value("document.querySelector('[data-show=trail]').checked")


def test_it_shows_the_episode_that_is_clicked_on(
    page: Browser, episodes: list[EpisodeSummary]
) -> None:
    page.click(".episode[data-number='2']")
    assert shown(page) == (2, 0)
    assert text(page, "#clock") == f"0.0 / {episodes[2].duration:.1f} s"
    assert page.value("document.querySelector('[aria-selected=true]').dataset.number") == "2"
    page.click("#curve", across=0.98)
    assert shown(page) == (3, 0)


def test_the_list_and_the_curve_tell_durations_and_outcomes(
    page: Browser, episodes: list[EpisodeSummary]
) -> None:
    for episode in episodes:
        row = text(page, f".episode[data-number='{episode.number}']")
        assert f"{episode.duration:.1f} s" in row
        assert episode.outcome.name.lower().replace("_", " ") in row
    mean = sum(episode.duration for episode in episodes) / 4
    assert text(page, "#summary").startswith(f"4, mean {mean:.1f} s")


def moment_with_values(track: Track) -> tuple[int, int]:
    """A cycle and a keeper whose learner was asked in it."""
    cycles, players = np.nonzero(np.isfinite(track.values[:, :3, 0]))
    return int(cycles[-1]), int(players[-1])


def test_it_shows_what_the_learner_expected_and_what_was_chosen(
    page: Browser, bag: MatchBag, episodes: list[EpisodeSummary]
) -> None:
    track = bag.track(episodes[0])
    cycle, keeper = moment_with_values(track)
    page.value(f"choosePlayer({keeper}); seek({cycle})")
    bars = page.value("[...document.querySelectorAll('.value b')].map(e => e.textContent)")
    assert bars == [f"{value / 10:.1f} s" for value in track.values[cycle, keeper]]
    chosen = page.value("[...document.querySelectorAll('.value.chosen')].map(e => e.textContent)")
    assert len(chosen) == 1
    action = track.requested[cycle, keeper]
    target = track.requested_target[cycle, keeper]
    assert chosen[0].startswith("hold" if action == 0 else f"pass to K{target + 1}")


def test_the_last_choice_stays_until_there_is_a_new_one(
    page: Browser, bag: MatchBag, episodes: list[EpisodeSummary]
) -> None:
    asked = np.isfinite(bag.track(episodes[0]).values[:, :3, 0])
    chose, keeper = np.argwhere(asked[:-1] & ~asked[1:])[0].tolist()
    page.value(f"choosePlayer({keeper}); seek({chose})")
    now = page.value("[...document.querySelectorAll('.value')].map(e => e.textContent)")
    page.value(f"seek({chose + 1})")
    assert page.value("[...document.querySelectorAll('.past')].map(e => e.textContent)") == now
    assert "last chose, 0.1 s ago" in text(page, "#mind")
    page.value("seek(0)")
    if not asked[0, keeper]:
        assert "No learner has chosen for it yet" in text(page, "#mind")


def test_it_tells_how_far_a_players_belief_is_off(
    page: Browser, bag: MatchBag, episodes: list[EpisodeSummary]
) -> None:
    track = bag.track(episodes[1])
    page.value("select(1); choosePlayer(1); seek(20)")
    known = (track.age[20, 1] <= 12) & (np.arange(6) != 1)
    off = np.linalg.norm(track.believed[20, 1] - track.position[20], axis=1)[known].max()
    assert f"{off:.1f} m from the true place" in text(page, "#mind")


def colour_at(page: Browser, place: np.ndarray) -> tuple[int, ...]:
    """What is drawn at a place on the field [m]."""
    x, y = place.tolist()
    found = page.value(
        f"(() => {{ draw(); const [x, y] = px([{x}, {y}]);"
        " return [...pen.getImageData(Math.round(x), Math.round(y), 1, 1).data]; })()"
    )
    return tuple(found[:3])


def test_players_and_ball_are_drawn_where_they_were(
    page: Browser, bag: MatchBag, episodes: list[EpisodeSummary]
) -> None:
    track = bag.track(episodes[0])
    page.value(
        "for (const name of ['belief', 'names', 'trail', 'cones']) view.show[name] = false;"
        "choosePlayer(-1); seek(15)"
    )
    assert colour_at(page, track.position[15, 5]) == (255, 255, 255)
    for player in range(5):
        behind = track.position[15, player] - 0.2 * np.array(
            [math.cos(track.yaw[15, player]), math.sin(track.yaw[15, player])]
        )
        if np.linalg.norm(track.position[15, 5] - behind) > 1.0:
            expected = (0x56, 0xB4, 0xE9) if player < 3 else (0xFF, 0x9E, 0x4A)
            assert colour_at(page, behind) == expected


def test_a_click_on_the_field_chooses_the_player_there(
    page: Browser, bag: MatchBag, episodes: list[EpisodeSummary]
) -> None:
    place = bag.track(episodes[0]).position[0, 2]
    page.value("choosePlayer(-1); seek(0)")
    size = 25 + 2 * 1.6
    page.click("#field", across=0.5 + place[0] / size, down=0.5 - place[1] / size)
    assert page.value("view.player") == 2


@pytest.mark.parametrize(("width", "height"), [(1024, 768), (1366, 768), (1920, 1080)])
def test_nobody_scrolls_on_a_wide_screen(page: Browser, width: int, height: int) -> None:
    page.resize(width, height)
    page.value(PICTURE)
    assert page.value("document.documentElement.scrollHeight") <= height


@pytest.mark.parametrize(
    ("width", "height", "scale"), [(360, 740, 3.0), (768, 1024, 2.0), (1920, 1080, 1.0)]
)
def test_it_fits_phones_tablets_and_projectors(
    page: Browser, file: Path, width: int, height: int, scale: float
) -> None:
    page.open(file.as_uri(), width, height, scale)
    page.value(PICTURE)
    assert page.value("document.documentElement.scrollWidth <= innerWidth")
    field = page.value("document.getElementById('field').getBoundingClientRect().toJSON()")
    assert field["width"] >= min(0.9 * width, 0.55 * height)
    play = page.value("document.getElementById('play').getBoundingClientRect().toJSON()")
    assert play["bottom"] <= height  # nobody scrolls to play
    buttons = page.value(
        "[...document.querySelectorAll('#transport .buttons button')].filter(b => b.offsetParent)"
        ".map(b => Math.min(b.offsetWidth, b.offsetHeight))"
    )
    assert min(buttons) >= 36  # of a finger
