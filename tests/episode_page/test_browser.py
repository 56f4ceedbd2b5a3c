"""A page in headless Chromium, opened from disk without a network."""

import cv2
import numpy as np
import pytest
from chromium import SOFTWARE_GL, WITHOUT_GL, Browser, chromium_driver
from recorded import RATE_HZ, record

from veca_marl.runs.episode_page import write_page
from veca_marl.runs.episode_page.description import POSITION_UNIT_M
from veca_marl.runs.episode_page.media import read_sheet

pytestmark = pytest.mark.slow
READY = "document.documentElement.dataset.state === 'ready'"
TASK = ("+task=MultiAgentNav", "task.max_seconds=2.0")


@pytest.fixture(scope="module")
def made():
    chromium_driver()
    return record(*TASK)


@pytest.fixture(scope="module")
def page(made, tmp_path_factory):
    path = tmp_path_factory.mktemp("page") / "episode.html"
    write_page(path, made.episode)
    return path


@pytest.fixture(scope="module")
def browser(tmp_path_factory):
    with Browser(tmp_path_factory.mktemp("profile"), flags=SOFTWARE_GL) as opened:
        yield opened


@pytest.fixture
def opened(browser, page):
    browser.open(page)
    browser.wait_until(READY)
    yield browser
    assert not browser.errors(), "nothing in the console, nothing loaded from elsewhere"


def picture(browser):
    image = cv2.imdecode(np.frombuffer(browser.screenshot(), np.uint8), cv2.IMREAD_COLOR)
    assert image is not None
    return image.astype(int)


def test_time_advances_and_ends_with_the_episode(opened):
    assert opened.run("return episodePage.clock.time") == 0.0
    opened.run("episodePage.setLoop(false); episodePage.toggle()")
    opened.wait_until("episodePage.clock.time > 0.5")
    opened.wait_until("!episodePage.clock.isPlaying")
    assert opened.run("return episodePage.clock.time") == pytest.approx(2.0, abs=1e-6)
    shown = opened.run("return document.getElementById('time').textContent")
    assert "step 50" in shown


def test_a_body_is_seen_where_it_is_and_only_there(opened):
    opened.run("episodePage.clock.seek(1.0)")
    opened.wait_until("performance.now() > episodePage.lively")
    with_body = picture(opened)
    opened.run(
        "for (const s of episodePage.world.skins) s.mesh.visible = false; episodePage.stir()"
    )
    opened.wait_until("performance.now() > episodePage.lively")
    without = picture(opened)
    changed = (np.abs(with_body - without) > 40).any(axis=2)
    assert 500 < changed.sum() < 0.25 * changed.size
    rows, columns = np.nonzero(changed)
    left, top, width, height = opened.run(
        "const r = document.getElementById('view').getBoundingClientRect();"
        "return [r.left, r.top, r.width, r.height]"
    )
    assert left < columns.mean() < left + width
    assert top < rows.mean() < top + height


@pytest.mark.parametrize("step", [0, 17, 50])
def test_the_skin_is_that_of_the_simulator(opened, made, step):
    opened.run(f"episodePage.world.setTime({step})")
    bodies = opened.run("return episodePage.world.skins.map((s) => Array.from(s.vertices))")
    drawn = np.concatenate([np.reshape(vertices, (-1, 3)) for vertices in bodies])
    np.testing.assert_allclose(drawn, made.vertices[step], atol=6.0 * POSITION_UNIT_M)


def test_touched_taxels_are_marked(opened, made):
    name = made.episode.agents[0].name
    step = max(range(51), key=lambda n: made.observations[n][name]["touch"].sum())
    opened.run(f"episodePage.world.setTime({step})")
    marked = np.array(opened.run("return Array.from(episodePage.world.skins[0].texels)"))[:9888]
    touch = made.observations[step][name]["touch"]
    assert touch.any()
    np.testing.assert_allclose(marked / 255.0, touch, atol=1.0 / 255.0)


def coloured(browser):
    """The number of pixels of the chart of the skin that are neither grey nor blank."""
    return browser.run(
        "const c = document.getElementById('skinview'); let n = 0;"
        "const d = c.getContext('2d').getImageData(0, 0, c.width, c.height).data;"
        "for (let i = 0; i < d.length; i += 4) n += d[i + 3] > 200 && d[i] - d[i + 2] > 60;"
        "return n"
    )


def test_the_chart_shows_what_is_touched(opened, made):
    name = made.episode.agents[0].name
    step = max(range(51), key=lambda n: made.observations[n][name]["touch"].sum())
    opened.run(f"episodePage.clock.seek({0.04 * step})")
    opened.wait_until(f"episodePage.panels.parts[1].step === {step}")
    assert coloured(opened) > 5
    opened.run("episodePage.agent.touch.firsts.fill(0); episodePage.clock.seek(0.4)")
    opened.wait_until("episodePage.panels.parts[1].step === 10")
    assert coloured(opened) == 0


def test_a_click_on_the_time_line_seeks(opened):
    opened.run(
        "const t = episodePage.timeline; const r = t.box.getBoundingClientRect();"
        "t.box.setPointerCapture = () => {};"
        "t.box.dispatchEvent(new PointerEvent('pointerdown', {button: 0,"
        "clientX: r.left + t.area.left + 0.75 * t.area.width, clientY: r.top + 20}))"
    )
    assert opened.run("return episodePage.clock.time") == pytest.approx(1.5, abs=0.02)


def test_sound_seeks_and_slows_down_with_the_time(opened):
    opened.run("episodePage.setSpeed(0.1); episodePage.clock.seek(0.5); episodePage.toggle()")
    opened.wait_until("episodePage.clock.sound.position() > 0.5")
    began, rate, speed = opened.await_(
        "const s = episodePage.clock.sound;"
        "const now = () => [s.position(), s.context.currentTime];"
        "const a = now(); await new Promise((go) => setTimeout(go, 400)); const b = now();"
        "return [a[0], s.source.playbackRate.value, (b[0] - a[0]) / (b[1] - a[1])]"
    )
    assert 0.5 < began < 2.0
    assert rate == pytest.approx(0.1)
    assert speed == pytest.approx(0.1, rel=0.2)


def test_eyes_are_those_of_the_chosen_agent(opened, made):
    opened.run("episodePage.setAgent(1); episodePage.clock.seek(30 * 0.04)")
    opened.wait_until("episodePage.panels.parts[0].step === 30")
    shown = opened.run(
        "const c = document.getElementById('eye1');"
        "return Array.from(c.getContext('2d').getImageData(0, 0, c.width, c.height).data)"
    )
    agent = made.episode.agents[1]
    rgb = np.reshape(shown, (*agent.picture_size, 4))[..., :3]
    stored = read_sheet(agent.pictures[1], agent.picture_size)[30 - 25, 1].transpose(1, 2, 0)
    assert np.abs(rgb - stored).mean() < 2.0
    assert (
        np.abs(
            stored.astype(int) - made.observations[30][agent.name]["vision"][1].transpose(1, 2, 0)
        ).mean()
        < 2.0
    )


def test_sound_decodes_and_leads_the_time(opened, made):
    sound = opened.run(
        "const b = episodePage.agent.sound.buffer; let s = 0;"
        "for (const v of b.getChannelData(0)) s += v * v;"
        "return [b.numberOfChannels, b.duration, Math.sqrt(s / b.length)]"
    )
    samples = made.episode.agents[0].waveform.shape[1]
    assert sound[0] == 2
    assert sound[1] == pytest.approx(samples / RATE_HZ, abs=0.03)
    opened.run("episodePage.toggle()")
    opened.wait_until("episodePage.clock.sound.position() > 0.1")
    apart = "Math.abs(episodePage.clock.sound.position() - episodePage.clock.time)"
    assert opened.run(f"return {apart}") < 0.6, "a software renderer draws few pictures a second"


def test_keys_change_time_speed_camera_and_agent(opened):
    def press(key, shift=False):
        opened.run(
            "document.dispatchEvent(new KeyboardEvent('keydown', {key: arguments[0], "
            "shiftKey: arguments[1]}))",
            key,
            shift,
        )

    press("ArrowRight", shift=True)
    press("ArrowRight")
    press("ArrowLeft")
    press("ArrowDown")
    press("3")
    press("a")
    press("l")
    state = opened.run(
        "const p = episodePage;"
        "return [p.clock.time, p.clock.speed, p.view.mode, p.number, p.clock.loops]"
    )
    assert state == [pytest.approx(1.0), 0.5, "left", 1, False]


def test_the_camera_is_in_the_eye(opened):
    opened.run("episodePage.setCamera('right'); episodePage.clock.seek(1.2)")
    opened.wait_until("episodePage.shown === 30")
    at, eye, hidden = opened.run(
        "const p = episodePage; const f = p.agent.firstEye + 1;"
        "const eye = Array.from(p.world.poses.position.subarray(3 * f, 3 * f + 3));"
        "return [p.view.camera.position.toArray(), eye,"
        "p.world.skins[0].isHeadHidden]"
    )
    assert at == pytest.approx(eye)
    assert hidden


def test_without_webgl_one_sentence_says_so_and_the_rest_works(page, tmp_path):
    with Browser(tmp_path, flags=WITHOUT_GL) as browser:
        browser.open(page)
        browser.wait_until(READY)
        notice = browser.run("return document.getElementById('notice').innerText")
        assert "WebGL" in notice
        assert notice.count(".") == 1
        browser.run("episodePage.toggle()")
        browser.wait_until("episodePage.clock.time > 0.2")
        browser.wait_until("episodePage.panels.parts[0].step > 2")


@pytest.mark.parametrize("share", [0.3, 0.6, 0.9])
def test_a_page_that_was_cut_off_says_so(browser, page, tmp_path, share):
    text = page.read_text()
    (tmp_path / "cut.html").write_text(text[: int(share * len(text))])
    browser.open(tmp_path / "cut.html")
    message = browser.run("return document.body.innerText")
    assert "incomplete" in message
    browser.errors()


def test_a_page_that_was_altered_says_so(browser, page, tmp_path):
    text = page.read_text()
    at = text.index('id="data">') + 5000
    (tmp_path / "altered.html").write_text(text[:at] + "AAAA" + text[at + 4 :])
    browser.open(tmp_path / "altered.html")
    browser.wait_until("document.getElementById('message')?.classList.contains('failed')")
    assert "altered" in browser.run("return document.body.innerText")
    browser.errors()
