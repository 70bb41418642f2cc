"""An explorer served in a thread, and Chromium to open it in."""

import asyncio
import concurrent.futures
import threading

import pytest

import pbrdf
from browser import chromium


@pytest.fixture
def served():
    """A function that serves what a workspace makes and gives the address with its token."""
    from pbrdf.explorer.server import serve

    running = []

    def start(open_workspace):
        ready = threading.Event()
        address = []
        loop = asyncio.new_event_loop()

        def tell(text):
            address.append(text)
            ready.set()

        def run():
            asyncio.set_event_loop(loop)
            task = loop.create_task(serve(open_workspace, 0, tell))
            running.append((loop, task, threading.current_thread()))
            try:
                loop.run_until_complete(task)
            except asyncio.CancelledError:
                pass
            finally:
                loop.close()

        threading.Thread(target=run, daemon=True).start()
        assert ready.wait(30)
        return address[0]

    yield start
    for loop, task, thread in running:
        loop.call_soon_threadsafe(task.cancel)
        thread.join(10)


@pytest.fixture
def apart():
    """A function that calls another in a thread of its own: where Playwright is at work, its loop runs in this one."""

    def call(function, *arguments):
        with concurrent.futures.ThreadPoolExecutor(1) as pool:
            return pool.submit(function, *arguments).result(60)

    return call


@pytest.fixture(scope="module")
def chrome():
    with chromium() as browser:
        yield browser


@pytest.fixture
def page(chrome):
    """A new tab; the test fails where a script of the page did."""
    context = chrome.new_context(viewport={"width": 1280, "height": 800})
    tab = context.new_page()
    faults = []
    tab.on("pageerror", lambda error: faults.append(str(error)))
    yield tab
    context.close()
    assert faults == []


@pytest.fixture
def white():
    return pbrdf.load_paint("matte-white-thick")
