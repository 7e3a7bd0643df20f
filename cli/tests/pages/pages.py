"""Tests of the HTML pages in a real browser.

python3 pages.py PROGRAM LAB EXAMPLES SCRATCH [--screenshots DIR] [--picture FILE.png] [--only PAGE]: makes the pages, opens
each at two widths and in both themes, and prints a line for each. Ends with status 1 at a fault.
"""

import argparse
import base64
import json
import os
import pathlib
import re
import shutil
import subprocess
import sys

from playwright.sync_api import sync_playwright

import axe
import parallel

SCREENS = {
    "desk": {"viewport": {"width": 1280, "height": 900}},
    "phone": {
        "viewport": {"width": 360, "height": 780},
        "device_scale_factor": 2,
        "is_mobile": True,
        "has_touch": True,
    },
}
# Pairs of labels of one axis whose boxes meet.
TOUCHING = """() => [...document.querySelectorAll(".plot")].flatMap((plot) =>
    [".xtick text", ".ytick text", ".y2tick text"].flatMap((labels) => {
        const all = [...plot.querySelectorAll(labels)].map((one) => [one.textContent, one.getBoundingClientRect()]);
        const meet = (a, b) => a.left < b.right && b.left < a.right && a.top < b.bottom && b.top < a.bottom;
        return all.flatMap(([text, box], at) =>
            all.slice(at + 1).filter(([, other]) => meet(box, other)).map(([other]) => `${text} and ${other}`));
    }))"""
# Pages in a folder with other files.
IN_FOLDERS = {"flights", "reproduction"}
# Largest size of a page.
MOST_BYTES = 6_000_000


class Wrong(Exception):
    """A fault of a page."""


def expect(is_so, what):
    if not is_so:
        raise Wrong(what)


def pages_of_programs(program, lab, examples):
    """For every page: program and command, sections, least number of plots. A command that writes one page has `--report`
    added; where the page has margins it has `--json` as well."""
    identified = {"recording", "fit", "process", "stability", "step", "controller", "styles"}
    recording = lambda name: ["identify", str(examples / name)]
    tune = ["tune", "--k", "1", "--t-prop", "0.3", "--t-body", "2", "--tau", "0.1"]
    return {
        "flight": (program, recording("logs/px4_chirps.ulg"), {"flight", "roll-rate", "roll-rate-fit", "yaw-rate"}, 20),
        "hover": (program, recording("simulated_hover.csv"), identified, 12),
        "roll": (program, recording("jsbsim_f450_roll_clean.csv"), identified | {"remarks"}, 12),
        "bias": (program, recording("rotorpy_sih_alt_bias30.csv"), identified | {"remarks"}, 12),
        "refused": (program, recording("unsteady_ardupilot_alt.csv"), {"recording"}, 1),
        "tuned": (program, tune, {"stability", "step", "controller", "styles"}, 3),
        "grid": (lab, ["grid"], {"shapes", "times", "rays"}, 5),
        "phase": (lab, ["phase"], {"cost", "shapes"}, 2),
        "certificate": (lab, ["certify", "--shapes", "6"], {"corners", "bias"}, 2),
        "flights": (program, ["fly", "altitude", "vehicle"], {"altitude", "vehicle"}, 6),
        "reproduction": (lab, ["reproduce", "phase", "--quick"], {"phase"}, 1),
    }


def made(name, program, command, folder):
    """Makes a page; returns its path."""
    if name not in IN_FOLDERS:
        path = folder / f"{name}.html"
        run(program, [*command, "--report", str(path)])
        return path
    run(program, [*command, "-o", str(folder / name)])
    return next((folder / name).glob("*.html"))


def run(program, arguments):
    done = subprocess.run([program, *arguments], capture_output=True, text=True, check=False)
    # 4 is a negative result, which has a page too.
    expect(done.returncode in (0, 4), f"{arguments[0]} ended with {done.returncode}: {done.stderr}")
    return done.stdout


def opened(browser, path, screen):
    """Opens the page in a new window; returns it with lists of its errors and requests."""
    window = browser.new_context(**SCREENS[screen], color_scheme="light")
    page = window.new_page()
    faults, fetched = [], []
    page.on("console", lambda line: faults.append(line.text) if line.type in ("error", "warning") else None)
    page.on("pageerror", lambda error: faults.append(str(error)))
    page.on("request", lambda request: fetched.append(request.url))
    page.goto(path.as_uri())
    drawn(page)
    return page, faults, fetched


def drawn(page):
    """Waits until all plots are drawn in the theme of the page."""
    page.wait_for_function("(root => root.dataset.drawn === root.dataset.theme)(document.documentElement)")


def pages_of(paper):
    """The number of pages of a PDF of Chromium."""
    return len(re.findall(rb"/Type\s*/Page\b(?!s)", paper))


def first_screens(page):
    """Checks that the card and both responses are on the first screen of a desk and the first two of a phone, and that all
    else is folded."""
    before = page.viewport_size
    for (width, height), screens in (((1440, 900), 1), ((1366, 657), 1), ((390, 844), 2)):
        page.set_viewport_size({"width": width, "height": height})
        ends = page.evaluate(
            "[...document.querySelectorAll('.beside table, .beside .plot')].filter((one) => one.clientWidth)"
            ".map((one) => one.getBoundingClientRect().bottom + scrollY)")
        expect(len(ends) == 2 and max(ends) < screens * height, f"card and responses end at {ends} of {screens} x {height}")
    page.set_viewport_size(before)
    expect(page.locator("details.group[open]:visible").count() == 0, "a group is open")


def copy(page):
    """Checks that the button copies names and values of the card."""
    page.context.grant_permissions(["clipboard-read", "clipboard-write"])
    place = page.locator(".copy:visible").first
    place.locator("button").click()
    place.locator("span", has_text="Copied.").wait_for()
    copied = page.evaluate("navigator.clipboard.readText()")
    rows = page.locator(".beside table:visible th").all_text_contents()
    names = [line.split(" ")[0] for line in copied.split("\n")]
    expect(all(any(row.startswith(name) for row in rows) for name in names), f"copied {names}, on the card {rows}")


def turn_tabs(page):
    """Checks the tabs of a flight by keyboard, mouse, links and the address."""
    tabs = page.locator("[role=tab]")
    shown = lambda: page.eval_on_selector_all("[role=tabpanel]", "all => all.filter((one) => !one.hidden).map((one) => one.id)")
    expect(shown() == ["flight"], f"{shown()} is shown first")
    tabs.first.focus()
    for key, wanted in (("ArrowRight", "roll-rate"), ("End", "yaw-rate"), ("ArrowRight", "flight"), ("ArrowLeft", "yaw-rate"), ("Home", "flight")):
        page.keyboard.press(key)
        expect(shown() == [wanted], f"{key} shows {shown()}, not {wanted}")
        focused = page.evaluate("document.activeElement.getAttribute('aria-controls')")
        expect(focused == wanted, f"{key} leaves the focus on {focused}")
    page.locator(".cards a", has_text="Pitch").click()
    # The page follows its address as soon as the browser says that it has changed.
    page.locator("#pitch-rate").wait_for()
    expect(shown() == ["pitch-rate"], f"the link shows {shown()}")
    page.locator("[role=tab]", has_text="Roll").click()
    expect(shown() == ["roll-rate"] and page.url.endswith("#roll-rate"), f"{shown()} at {page.url}")
    drawn(page)


def accessible(page):
    found = axe.violations(page)
    expect(not found, f"axe finds {found}")


def unfold(page):
    """Shows all panels and opens all groups, which draws their plots."""
    page.evaluate("""document.querySelectorAll("[role=tabpanel]").forEach((one) => { one.hidden = false; });
                     document.querySelectorAll("details").forEach((one) => { one.open = true; })""")
    page.wait_for_function("[...document.querySelectorAll('.plot')].every((one) => one.querySelector('.main-svg'))")


def look(page, path, sections, least_plots):
    """Checks sections, plots, widths and labels."""
    ids = set(page.eval_on_selector_all("main section", "all => all.map((one) => one.id)"))
    expect(sections <= ids, f"sections {sorted(sections - ids)} are missing")
    plots = page.locator(".plot")
    count = plots.count()
    expect(count >= least_plots, f"{count} plots instead of {least_plots} or more")
    drawn = page.locator(".plot .main-svg >> nth=0").count()
    expect(drawn > 0, "nothing is drawn")
    sizes = page.eval_on_selector_all(
        ".plot",
        """all => all.map((one) => {
            const svg = one.querySelector(".main-svg")?.getBoundingClientRect();
            const box = one.getBoundingClientRect();
            return { drawn: svg?.width ?? 0, room: box.width, traces: one.querySelectorAll(".trace, .contourlayer, .heatmaplayer image").length };
        })""",
    )
    for number, size in enumerate(sizes):
        expect(size["traces"] > 0, f"plot {number} shows nothing")
        expect(abs(size["drawn"] - size["room"]) < 2, f"plot {number} is {size['drawn']} wide, with room for {size['room']}")
    width = page.evaluate("[document.documentElement.scrollWidth, innerWidth]")
    expect(width[0] <= width[1], f"the page is {width[0]} wide in a window of {width[1]}")
    scrolls = page.eval_on_selector_all(
        ".table", "all => all.filter((one) => one.scrollWidth > one.clientWidth).map((one) => one.innerText.slice(0, 60))"
    )
    expect(not scrolls, f"tables scroll sideways: {scrolls}")
    touching = page.evaluate(TOUCHING)
    expect(not touching, f"labels touch: {touching}")
    expect(path.stat().st_size < MOST_BYTES, f"{path.stat().st_size} bytes")


def colours(page):
    """Colours of the page and of the labels of its first plot."""
    return page.evaluate(
        """() => [getComputedStyle(document.body).backgroundColor,
                  getComputedStyle(document.querySelector(".plot .xtitle, .plot .xtick text")).fill]"""
    )


def turn(page):
    """Switches the theme."""
    page.click("#theme")
    drawn(page)


def switch(page):
    """Checks that the button switches page and plots to dark and back."""
    light = colours(page)
    turn(page)
    dark = colours(page)
    expect(dark[0] != light[0], f"the page stays {light[0]}")
    expect(dark[1] != light[1], f"the words of the plots stay {light[1]}")
    turn(page)
    expect(colours(page) == light, "the page does not turn light again")


def print_out(page):
    """Checks that a dark page is printed light."""
    turn(page)
    paper = page.pdf(format="A4")
    expect(paper.startswith(b"%PDF") and len(paper) > 20_000, f"{len(paper)} bytes on paper")
    if page.locator("details.group").count():
        expect(pages_of(paper) <= 2, f"{pages_of(paper)} pages of paper")
    drawn(page)
    page.evaluate("dispatchEvent(new Event('beforeprint'))")
    on_paper = page.evaluate(
        "[...document.querySelectorAll('.plot .main-svg')].map((one) => one.getBoundingClientRect().right)")
    edge = page.evaluate("document.body.getBoundingClientRect().right")
    expect(max(on_paper) < edge + 1, f"a plot ends at {max(on_paper)}, the paper at {edge}")
    expect(page.evaluate("document.documentElement.dataset.theme") == "light", "dark pages are printed dark")
    page.evaluate("dispatchEvent(new Event('afterprint'))")
    drawn(page)
    turn(page)


def handle(page):
    """Checks the mouse on the first plot: hover label, zoom, reset, download."""
    plot = page.locator(".plot").first
    plot.scroll_into_view_if_needed()
    box = plot.bounding_box()
    across = lambda part: box["x"] + part * box["width"]
    height = box["y"] + 0.3 * box["height"]
    ticks = lambda: sorted(plot.locator(".xtick text").all_text_contents())
    page.mouse.move(across(0.5), height)
    expect(plot.locator(".hoverlayer .hovertext").first.text_content(timeout=5000), "no label under the mouse")
    before = ticks()
    page.mouse.move(across(0.4), height)
    page.mouse.down()
    page.mouse.move(across(0.6), height, steps=5)
    page.mouse.up()
    expect(ticks() != before, f"a closer look still shows {before}")
    page.mouse.dblclick(across(0.5), height)
    page.wait_for_timeout(500)
    expect(ticks() == before, f"{ticks()} instead of {before} again")
    page.mouse.move(across(0.5), height)
    with page.expect_download() as download:
        plot.locator(".modebar-btn").first.click()
    expect(download.value.suggested_filename.endswith(".png"), "no picture to keep")


def annotations(page):
    return page.eval_on_selector_all(".annotation-text", "all => all.map((one) => one.textContent)")


def margins(page, report):
    """Checks that the margins in the plots equal those of --json."""
    words = annotations(page)
    phase = f"phase margin {report['margins']['phase_margin_deg']:.1f} deg"
    gain = f"gain margin {report['margins']['gain_margin']:.2f}"
    for wanted in (phase, gain):
        found = [text for text in words if text.startswith(wanted)]
        expect(len(found) == 2, f"'{wanted}' stands in {len(found)} plots, not in two: {words}")
    overshoot = f"overshoot {100 * report['step']['overshoot']:.0f} %"
    expect(overshoot in words, f"'{overshoot}' is not among {words}")
    return phase


# Plots of the identification: fit, posterior, Nyquist plot, step response.
PICTURED = ["#fit figure", "#process .row:has(.square)", "#stability figure", "#step figure"]


def picture(browser, page, path):
    """Saves four plots of a page as one picture."""
    shots = [page.locator(one).first.locator(".plot").all() for one in PICTURED]
    images = "".join(
        "<div>" + "".join(f'<img src="data:image/png;base64,{base64.b64encode(shot.screenshot()).decode()}">' for shot in row) + "</div>"
        for row in shots
    )
    frame = browser.new_context(viewport={"width": 1280, "height": 800}, device_scale_factor=2).new_page()
    frame.set_content(
        f"""<style>body {{ margin: 0; padding: 12px; width: 1256px; display: grid; grid-template-columns: 1fr 1fr; gap: 12px; background: #fff }}
        div {{ display: flex; gap: 8px; align-items: center }} img {{ min-width: 0; flex: 1; width: 0; }}</style>{images}"""
    )
    frame.screenshot(path=path, full_page=True)
    frame.context.close()


def check(browser, told, name, path, program, command, sections, plots):
    """Checks a page at both widths."""
    margins_told = json.loads(run(program, [*command, "--json"])) if "controller" in sections else None
    for screen in SCREENS:
        page, faults, fetched = opened(browser, path, screen)
        if name == "flight":
            turn_tabs(page)
        if screen == "desk" and {"controller", "recording"} <= sections or name == "flight":
            first_screens(page)
            copy(page)
        if screen == "desk":
            print_out(page)
        unfold(page)
        look(page, path, sections, plots)
        # Axe and the themes take seconds each and say the same at both widths: axe runs on the phone, where it is stricter.
        if screen == "phone" and ("recording" in sections or name == "flight"):
            accessible(page)
        if told.picture and (name, screen) == ("hover", "desk"):
            picture(browser, page, told.picture)
        if screen == "desk":
            switch(page)
        said = margins(page, margins_told) if margins_told else f"{len(annotations(page))} notes"
        if screen == "desk" and "recording" in sections:
            handle(page)
        expect(not faults, f"the browser complains: {faults}")
        others = [url for url in fetched if not re.match(r"file:|data:|blob:", url)]
        expect(not others, f"the page fetches {others}")
        took_ms = page.evaluate("performance.getEntriesByType('navigation')[0].loadEventEnd")
        print(f"{name:<13} {screen:<6} {path.stat().st_size / 1e6:.1f} MB, open after {took_ms:.0f} ms, {said}")
        if told.screenshots:
            save(page, told.screenshots / f"{name}-{screen}")
        page.context.close()


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("program")
    parser.add_argument("lab")
    parser.add_argument("examples", type=pathlib.Path)
    parser.add_argument("scratch", type=pathlib.Path)
    parser.add_argument("--screenshots", type=pathlib.Path)
    parser.add_argument("--picture", type=pathlib.Path)
    parser.add_argument("--only", metavar="PAGE", help="checks one page, such as hover")
    told = parser.parse_args()
    chromium = os.environ.get("CHROMIUM") or shutil.which("chromium")
    expect(chromium, "there is no chromium: install it, or name one in CHROMIUM")
    if told.screenshots:
        told.screenshots.mkdir(parents=True, exist_ok=True)
    pages = pages_of_programs(told.program, told.lab, told.examples)
    if not told.only:
        parallel.runs(pages)
        return
    with sync_playwright() as driver:
        browser = driver.chromium.launch(
            executable_path=chromium,
            args=["--no-sandbox", "--disable-gpu", "--disable-background-networking", "--disable-component-update"],
        )
        program, command, sections, plots = pages[told.only]
        path = made(told.only, program, command, told.scratch)
        check(browser, told, told.only, path, program, command, sections, plots)
        browser.close()


def save(page, path):
    page.screenshot(path=f"{path}.png", full_page=True)
    turn(page)
    page.screenshot(path=f"{path}-dark.png", full_page=True)


if __name__ == "__main__":
    try:
        main()
    except Wrong as wrong:
        sys.exit(f"fault: {wrong}")
