"""A real browser without network, or a skip that says what is missing."""

import os
import shutil
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path

import numpy as np
import pytest

from kinarm.recording import Recording, record_rollouts
from kinarm.simulator import Simulator
from kinarm.viewer import replay_page

REQUIRED = "KINARM_REQUIRE_BROWSER"
UNDRAWN = Path(__file__).with_name("undrawn.js")
PATIENCE = 120_000
"""How long a page may take for anything [ms]: without a graphics card, drawing is slow."""

FLAGS = (
    *("--headless=new", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"),
    *("--disable-background-networking", "--disable-component-update", "--disable-sync"),
    *("--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"),
)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """What needs a browser takes long: without a graphics card, it draws in software."""
    for item in items:
        if item.path.parent == Path(__file__).parent:
            item.add_marker("slow")


def do_without(reason: str) -> None:
    """Skip, unless the environment demands a browser."""
    if os.environ.get(REQUIRED) == "1":
        pytest.fail(f"{REQUIRED}=1, but {reason}")
    pytest.skip(reason)


@pytest.fixture(scope="session")
def browser() -> Iterator[object]:
    """One browser for all tests."""
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        do_without("playwright is not installed: pip install 'kinarm[test]'")
    chromium = shutil.which("chromium") or shutil.which("chromium-browser")
    if chromium is None:
        do_without("chromium is not installed: apt-get install chromium")
    with sync_playwright() as playwright:
        launched = playwright.chromium.launch(executable_path=chromium, args=list(FLAGS))
        yield launched
        launched.close()


@pytest.fixture(scope="session")
def new_context(browser: object) -> Callable[..., object]:
    """Begin a context without network, in which pages draw nothing unless they are to."""

    def begin(*, drawn: bool = False, **settings: object) -> object:
        context = browser.new_context(**{"offline": True, **settings})
        context.set_default_timeout(PATIENCE)
        if not drawn:
            context.add_init_script(UNDRAWN.read_text())
        return context

    return begin


class Watched:
    """A page, with everything that it asked for and complained about."""

    def __init__(self, context: object, path: Path) -> None:
        self.context = context
        self.page = self.context.new_page()
        self.requests: list[str] = []
        self.complaints: list[str] = []
        self.page.on("request", lambda request: self.requests.append(request.url))
        self.page.on("pageerror", lambda error: self.complaints.append(str(error)))
        self.page.on("console", self._listen)
        self.page.goto(path.as_uri())

    def _listen(self, message: object) -> None:
        if message.type == "error" or "THREE" in message.text:
            self.complaints.append(message.text)

    def tell(self, script: str) -> object:
        """Evaluate a script in the page."""
        return self.page.evaluate(script)

    def check_fit(self, size: tuple[int, int], *names: str) -> None:
        """See that the page is as large as the screen, and that elements lie on it."""
        self.page.wait_for_timeout(50)
        root = "document.documentElement"
        assert self.tell(f"[{root}.scrollWidth, {root}.scrollHeight]") == list(size)
        for name in names:
            box = self.page.locator(name).bounding_box()
            assert min(box["x"], box["y"]) >= 0, name
            assert box["x"] + box["width"] <= size[0], name
            assert box["y"] + box["height"] <= size[1], name

    @property
    def state(self) -> dict[str, object]:
        return self.tell("window.kinarm.state")


@pytest.fixture(scope="session")
def watch(new_context: Callable[..., object]) -> Callable[..., AbstractContextManager[Watched]]:
    """Open any page for the length of a ``with`` block."""

    @contextmanager
    def watched(path: Path, **settings: object) -> Iterator[Watched]:
        context = new_context(**settings)
        yield Watched(context, path)
        context.close()

    return watched


@pytest.fixture(scope="session")
def visit(
    watch: Callable[..., AbstractContextManager[Watched]],
) -> Callable[..., AbstractContextManager[Watched]]:
    """Open a replay page for the length of a ``with`` block, and wait until it is ready."""

    @contextmanager
    def visited(
        path: Path, size: tuple[int, int] = (800, 600), *, calm: bool = True, drawn: bool = False
    ) -> Iterator[Watched]:
        settings = {
            "drawn": drawn,
            "viewport": {"width": size[0], "height": size[1]},
            "color_scheme": "light",
            "reduced_motion": "reduce" if calm else "no-preference",
        }
        with watch(path, **settings) as opened:
            opened.page.wait_for_selector("body[data-ready]")
            yield opened

    return visited


@pytest.fixture(scope="session")
def recorded() -> list[Recording]:
    """Three random motions in ``both``, one of which collides."""
    simulator = Simulator("both", threads=1)
    count = 24
    starts, goals = simulator.sample(np.random.default_rng(0), count)
    shape = (count, simulator.task.horizon, simulator.n_actions)
    actions = np.random.default_rng(1).uniform(-1, 1, shape)
    rollouts = simulator.rollout_actions(actions, starts, goals, record=True)
    late = np.flatnonzero(rollouts.collision & (rollouts.steps > 5))[:1]
    chosen = [*np.flatnonzero(~rollouts.collision)[:2], *late]
    return record_rollouts(simulator, rollouts, "wave", chosen, steps_lower_bound=lambda _: 9)


@pytest.fixture(scope="session")
def page_file(recorded: list[Recording], tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("page") / "replay.html"
    replay_page(recorded, path)
    return path


@pytest.fixture(scope="module")
def watched(visit: Callable[..., object], page_file: Path) -> Iterator[Watched]:
    """The page, opened once for a file of tests."""
    with visit(page_file) as opened:
        yield opened
