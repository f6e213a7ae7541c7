"""Settings of the whole suite, and what many of its modules use."""

import asyncio
import gc
import os
import shutil
from collections.abc import Generator, Iterator

import pytest
from playwright.sync_api import Browser, sync_playwright

from nathlon.arena.kernels import compile_kernels
from nathlon.arena.pool import Pool
from nathlon.arena.world_finding import RACING

# Two test processes share two cores: BLAS and torch must not take more than one each.
for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")
# Nor may threads of torch, which a training tells to take two, spin on a core that the other process has.
os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")
# Nor may commands start a worker for each core, as each loads for seconds. Pools of two are asked for.
os.cpu_count = lambda: 1


def pytest_sessionstart(session: pytest.Session) -> None:
    """Have kernels compiled before test processes start, each of which would compile them itself."""
    if session.config.getoption("numprocesses", None):
        with Pool(2) as pool:
            compile_kernels(pool, RACING, "lindenring", "gt3", lambda done, total: None)


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """Leave what test modules load out of garbage collection, which would go through it time and again."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.enable()
        gc.freeze()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin with the modules that take long, so that no test process waits for another at the end."""
    items.sort(key=lambda item: item.get_closest_marker("takes_long") is None)


@pytest.fixture
def pool() -> Iterator[Pool]:
    """A pool of one process, which sees what the test has put on the path."""
    with Pool(1) as pool:
        yield pool


@pytest.fixture(scope="session")
def chromium() -> str:
    """The browser's executable."""
    executable = shutil.which("chromium")
    if executable is None:
        pytest.skip("needs Chromium: apt-get install chromium")
    return executable


@pytest.fixture(scope="session")
def running_chromium(chromium: str) -> Iterator[tuple[Browser, asyncio.AbstractEventLoop]]:
    """One Chromium for all modules of a test process, and the loop of Playwright's events."""
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        loop = asyncio.get_running_loop()
        yield browser, loop
        asyncio._set_running_loop(loop)
        browser.close()


@pytest.fixture(scope="module")
def browser(running_chromium: tuple[Browser, asyncio.AbstractEventLoop]) -> Iterator[Browser]:
    """Chromium, without pages of other modules.

    Playwright's loop counts as running all the time, and would stand in the way of the loops of modules that
    need no browser.
    """
    browser, loop = running_chromium
    asyncio._set_running_loop(loop)
    yield browser
    for context in browser.contexts:
        context.close()
    asyncio._set_running_loop(None)
