"""Cost of a moving frame of the report page, drawn without a graphics card.

You will see the processor seconds that all processes of the browser take for a frame of the impact,
and the part of them that the page's own scripts take. 16.7 ms a frame is 60 frames a second.

Run it: python examples/page_frames.py                  a run of the coarse rig, half a minute
        python examples/page_frames.py runs/rig-rom     a run folder with its report.html

Needs chromium and `./install.sh test` (playwright).
"""

import shutil
import sys
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory

import psutil
from playwright.sync_api import sync_playwright

import beadwave

COARSE = {"mesh.scale": 2.0, "time.error": 1e-3}
SOFTWARE = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
FRAMES = 60


def main(folder: str | None = None) -> None:
    with TemporaryDirectory() as temporary:
        if folder is None:
            beadwave.run("rig-rom", COARSE, out=Path(temporary, "run"))
        page = Path(folder or Path(temporary, "run"), "report.html").resolve()
        with sync_playwright() as driver:
            browser = driver.chromium.launch(
                executable_path=shutil.which("chromium") or shutil.which("chromium-browser"),
                args=SOFTWARE,
            )
            everything, scripts = frame_seconds(browser.new_page(), page.as_uri())
            browser.close()
    print(f"processor  {1e3 * everything:6.1f} ms a frame, all processes of the browser")
    print(f"scripts    {1e3 * scripts:6.1f} ms a frame, main thread of the page")


def frame_seconds(page, address: str) -> tuple[float, float]:
    """Processor seconds a frame of all processes, and of the page's main thread alone."""
    page.goto(address)
    page.wait_for_function("globalThis.beadwave?.clock")
    page.locator("#impact").scroll_into_view_if_needed()
    session = page.context.new_cdp_session(page)
    session.send("Performance.enable", {"timeDomain": "threadTicks"})
    page.evaluate("beadwave.clock.play(true)")
    played(page, 15)  # the view settles on its number of pixels
    before = processor_seconds(), main_thread_seconds(session), frames_of(page)
    played(page, FRAMES)
    frames = frames_of(page) - before[2]
    return (
        (processor_seconds() - before[0]) / frames,
        (main_thread_seconds(session) - before[1]) / frames,
    )


def frames_of(page) -> int:
    return page.evaluate("beadwave.clock.frames")


def played(page, n: int) -> None:
    """Wait for n more frames."""
    page.wait_for_function(
        "last => beadwave.clock.frames >= last", arg=frames_of(page) + n, timeout=120_000
    )


def main_thread_seconds(session) -> float:
    metrics = session.send("Performance.getMetrics")["metrics"]
    return next(metric["value"] for metric in metrics if metric["name"] == "TaskDuration")


def processor_seconds() -> float:
    """Of all processes that this one started and that still run, the browser's among them."""
    seconds = 0.0
    for child in psutil.Process().children(recursive=True):
        with suppress(psutil.NoSuchProcess):  # the browser ends one that it needs no more
            times = child.cpu_times()
            seconds += times.user + times.system
    return seconds


if __name__ == "__main__":
    main(*sys.argv[1:])
