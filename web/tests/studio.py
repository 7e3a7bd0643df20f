"""Tests of the studio in a real Chromium.

python3 studio.py PAGE PROGRAM REPOSITORY SCRATCH [--screenshots DIR] [--measure] [--only PART]: works as a user does, from
files dropped on the page to exported gains, and compares the numbers with those of the program. Prints a line for each
part; ends with status 1 at a fault. --measure prints times instead of testing.
"""

import argparse
import json
import math
import os
import pathlib
import statistics
import subprocess
import sys
import tempfile
import time

from playwright.sync_api import sync_playwright

sys.path.insert(0, str(pathlib.Path(__file__).parents[2] / "cli/tests/pages"))
import axe
import parallel

DESK = {"viewport": {"width": 1280, "height": 900}}
PHONE = {"viewport": {"width": 360, "height": 780}, "device_scale_factor": 2, "is_mobile": True, "has_touch": True}
# Largest relative difference of a number from the program's. The page computes sines and exponentials in Rust, the program
# with the system's library: they differ in the last bit, and the search for the best fit ends a few of its tolerances elsewhere.
CLOSE = 1e-3
# The design over draws ends where a search that begins anew lowers the mean load error by less than 0.1 %. Near the optimum the
# gains may then differ by the root of that, and what follows from them.
SAME_COST = 3e-3
SAME_GAINS = 2e-2
OF_DESIGN = (".answer", ".controller", ".margins", ".step", ".robustness", ".resonance_factor", ".limits_not_kept")
COST = ".mean_iae"
# Tests of the residuals, which are sums of small differences.
LOOSE = 5e-2
SIDE = (".innovations", ".refused", ".log")
# File, loop, and the options of the program for it.
FILES = [
    ("examples/simulated_hover.csv", None, []),
    ("examples/jsbsim_f450_roll_clean.csv", None, []),
    ("examples/unsteady_ardupilot_alt.csv", None, []),
    ("examples/logs/px4_chirps.ulg", "roll rate", ["--axis", "roll", "--loop", "rate"]),
    ("examples/logs/ap_sysid_roll.bin", "roll rate", ["--axis", "roll", "--loop", "rate"]),
    ("examples/logs/betaflight_acro.bfl", "roll rate", ["--axis", "roll", "--loop", "rate"]),
    ("link/tests/data/px4_zstd.mcap", "roll rate", ["--axis", "roll", "--loop", "rate"]),
]
# Of a flight that is refused, the last bits decide which samples are outliers, and with them the reason: only the refusal is
# compared.
REFUSED = "betaflight_acro.bfl"


class Wrong(Exception):
    """A fault of the page."""


def expect(is_so, what):
    if not is_so:
        raise Wrong(what)


class Studio:
    """The page in a browser, and what it did wrong."""

    def __init__(self, browser, path, fragment="", is_automatic=False, **screen):
        self.is_automatic = is_automatic
        self.context = browser.new_context(accept_downloads=True, **screen)
        self.context.set_offline(True)
        self.faults = []
        self.page = page = self.context.new_page()
        page.on("console", lambda message: message.type in ("error", "warning") and self.faults.append(message.text))
        page.on("pageerror", lambda error: self.faults.append(str(error)))
        self.questions = []
        page.on("dialog", self.asked)
        page.on("request", self.requested)
        self.path = path
        self.load(fragment)

    def load(self, fragment):
        """Loads the page anew, as a reload does."""
        self.page.goto("about:blank")
        self.page.goto(self.path.as_uri() + fragment)
        self.until("document.body.dataset.readyMs !== undefined || document.getElementById('state').className === 'bad'")
        expect(self.state() == "Ready.", self.state())
        # Most tests press Identify themselves.
        self.page.evaluate(f"isAutomatic = {str(self.is_automatic).lower()}")

    def asked(self, dialog):
        """Leaves the page when the browser asks; anything else is a fault."""
        self.questions.append(dialog.type)
        if dialog.type != "beforeunload":
            self.faults.append(f"dialog {dialog.message}")
        dialog.accept()

    def requested(self, request):
        if not request.url.startswith(("file:", "blob:", "data:", "about:")):
            self.faults.append(f"request for {request.url}")

    def until(self, condition, limit_s=90):
        # The page forbids eval, which the browser driver's own wait needs.
        end = time.monotonic() + limit_s
        while not self.page.evaluate(condition):
            if time.monotonic() > end:
                raise Wrong(f"{condition} does not come; the page says {self.state()!r}")
            time.sleep(0.02)

    def state(self):
        return self.page.inner_text("#state")

    def rest(self):
        self.until("document.getElementById('busy').hidden")

    def drop(self, name, content):
        """Drops a file of these bytes, or the file of this path."""
        self.page.evaluate("file = undefined")
        if isinstance(content, bytes):
            self.page.set_input_files("#file", {"name": name, "mimeType": "", "buffer": content})
        else:
            self.page.set_input_files("#file", content)
        self.until("typeof file === 'object'")
        self.rest()
        if self.is_automatic:
            self.until("report !== undefined")

    def drop_with_mouse(self, name, content):
        """The event of a real drop."""
        self.page.evaluate(
            """([name, text]) => {
                const data = new DataTransfer();
                data.items.add(new File([text], name));
                document.dispatchEvent(new DragEvent("drop", { dataTransfer: data, bubbles: true, cancelable: true }));
            }""",
            [name, content],
        )
        self.until("typeof file === 'object'")
        self.rest()

    def identify(self):
        self.page.click("#identify")
        self.rest()
        self.until("!document.getElementById('result').hidden || document.getElementById('state').className === 'bad'")

    def designed(self):
        self.until("!document.getElementById('calm').disabled && drawn?.step_band !== undefined")

    def saved(self, button):
        with self.page.expect_download() as download:
            self.page.click(button)
        return pathlib.Path(download.value.path()).read_text(encoding="utf-8"), download.value.suggested_filename

    def close(self):
        expect(not self.faults, "; ".join(self.faults))
        self.context.close()


def program(path, *arguments):
    done = subprocess.run([path, *arguments], capture_output=True, text=True, check=False)
    return json.loads(done.stdout)


def differences(ours, theirs, at=""):
    """Yields the relative difference of every pair of numbers."""
    expect(type(ours) is type(theirs) or {type(ours), type(theirs)} == {int, float}, f"{at}: {ours} and {theirs}")
    if isinstance(ours, dict):
        expect(list(ours) == list(theirs), f"{at}: other keys")
        for key in ours:
            yield from differences(ours[key], theirs[key], f"{at}.{key}")
    elif isinstance(ours, list):
        expect(len(ours) == len(theirs), f"{at}: {len(ours)} and {len(theirs)} values")
        for place, pair in enumerate(zip(ours, theirs)):
            yield from differences(*pair, f"{at}[{place}]")
    elif isinstance(ours, float):
        size = max(abs(ours), abs(theirs))
        yield at, 0.0 if size == 0.0 else abs(ours - theirs) / size


def numbers(studio, told):
    """Each format, against the program."""
    for name, loop, options in FILES:
        path = told.repository / name
        studio.drop(path.name, str(path))
        if loop:
            studio.page.select_option("#loop", loop)
            studio.rest()
        studio.identify()
        text, _ = studio.saved("#save-json")
        ours, theirs = json.loads(text), program(told.program, "identify", str(path), "--json", *options)
        ours["file"] = theirs["file"] = ""
        if path.name == REFUSED:
            kinds = [report["verdict"]["kind"] for report in (ours, theirs)]
            expect("identified" not in kinds, f"{name}: {kinds}")
            continue
        # Sentences have numbers too, rounded.
        for report in (ours, theirs):
            for key in ("remarks", "notes"):
                report[key] = len(report[key])
        # A process that was not chosen may have parameters that the recording does not determine.
        for report in (ours, theirs):
            # A fit far behind may come or go with the last bits.
            report["alternatives"] = [one["structure"] for one in report["alternatives"] or []][:1]
            # A design over draws keeps the limits on a number of them, which the last bits may change by one: that of the chosen
            # style is compared.
            report["controllers"] = [one for one in report["controllers"] or [] if one["is_chosen"]]
        found = list(differences(ours, theirs))
        same = sum(1 for _, difference in found if difference == 0.0)
        where, worst = max(found, key=lambda pair: pair[1])
        print(f"{name}: {same} of {len(found)} numbers equal to the bit, largest difference {worst:.1e} ({where})")
        for place, difference in found:
            limits = [(place.startswith(SIDE), LOOSE), (place.endswith(COST), SAME_COST), (place.startswith(OF_DESIGN), SAME_GAINS)]
            limit = next((limit for is_so, limit in limits if is_so), CLOSE)
            expect(difference <= limit, f"{name}: {place} differs by {difference:.1e}")


def by_hand(studio, told):
    """Gains moved, undone, compared and exported; by mouse and keyboard."""
    page = studio.page
    studio.drop("log", str(told.repository / "examples/logs/px4_chirps.ulg"))
    page.select_option("#loop", "roll rate")
    studio.rest()
    studio.identify()
    studio.designed()
    before = page.evaluate("({ ...gains })")
    page.focus("#slide-kp")
    for _ in range(20):
        page.keyboard.press("ArrowRight")
    studio.until("!isAsking && drawn?.step_band !== undefined")
    moved = page.evaluate("({ ...gains })")
    expect(moved["kp"] > 1.05 * before["kp"], f"the arrow keys move Kp from {before['kp']} to {moved['kp']}")
    expect(page.evaluate("drawn.figures.margins.phase_margin_deg") < page.evaluate("report.margins.phase_margin_deg"),
           "a larger gain has a smaller margin")
    expect(page.locator("#step path.band").count() == 1 and page.locator("#nyquist circle").count() == 1, "band and circle")
    expect(page.inner_text("#against-head") == "gains in force", "compared with the gains in force")
    kept = page.evaluate("location.hash")
    expect("kp=" in kept and "loop=roll" in kept and len(kept) < 300, kept)
    while page.is_enabled("#undo"):
        page.click("#undo")
    expect(page.evaluate("gains.kp") == before["kp"], "undo")
    page.click("#redo")
    expect(page.evaluate("gains.kp") > before["kp"], "redo")
    page.fill("#exact-kp", "1000")
    page.press("#exact-kp", "Enter")
    studio.until("drawn && !drawn.is_stable")
    expect("unstable" in page.inner_text("#step"), "an unstable loop is named")
    page.click("#save-whole")
    studio.until("document.getElementById('exported').className === 'bad'")
    expect("range" in page.inner_text("#exported"), page.inner_text("#exported"))
    page.click("#proposed")
    studio.until("drawn?.is_stable && !isAsking")
    # Each step is that of the program, whose default is the half.
    log = str(told.repository / "examples/logs/px4_chirps.ulg")
    new = {}
    for button, options in (("#save-whole", ["--step", "1"]), ("#save-half", [])):
        new[button], name = studio.saved(button)
        expect(name == "px4_chirps_roll_rate.params", name)
        expect(button.split("-")[1] in page.inner_text(button).lower(), "the button says which step it saves")
        same_parameters(new[button], written(told, log, "roll", options))
    old, name = studio.saved("#save-restore")
    expect(name == "px4_chirps_roll_rate.restore.params", name)
    expect(parameters(new["#save-whole"])["MC_ROLLRATE_P"] > parameters(new["#save-half"])["MC_ROLLRATE_P"]
           > parameters(old)["MC_ROLLRATE_P"], f"{new} and {old}")
    judged, name = studio.saved("#save-gains")
    expect(json.loads(judged)["judged"]["is_stable"] and name == "px4_chirps_roll_rate.gains.json", name)
    calm = page.evaluate("designs[0].controller.kp")
    page.evaluate("document.getElementById('calm').value = 0; document.getElementById('calm').oninput()")
    studio.until("!isAsking && drawn.step_band !== undefined")
    expect(page.evaluate("gains.kp") == calm, "the slider from calm to sharp")
    html, name = studio.saved("#save-report")
    expect(name == "px4_chirps_roll_rate.html" and "<h1>" in html and len(html) > 1_000_000, name)
    page.click("#report summary")
    studio.rest()
    studio.until("document.getElementById('frame').contentDocument?.querySelectorAll('.plot svg').length > 4")
    print("sliders, undo, comparison, export, report: as they should be")


def parameters(text):
    """Values of a file of PX4 or ArduPilot."""
    lines = [line.replace("\t", ",").split(",") for line in text.splitlines() if not line.startswith("#")]
    return {line[2]: float(line[3]) for line in lines if len(line) == 5} or {line[0]: float(line[1]) for line in lines}


def written(told, log, axis, options=()):
    """The file that `onecycle identify --write` writes."""
    path = told.scratch / f"{axis}.params"
    program(told.program, "identify", log, "--axis", axis, "--loop", "rate", "--json", "--force", "--write", str(path), *options)
    return path.read_text(encoding="utf-8")


def same_parameters(ours, theirs):
    ours, theirs = parameters(ours), parameters(theirs)
    expect(list(ours) == list(theirs), f"{ours} and {theirs}")
    expect(all(abs(value / theirs[name] - 1) < 2 * CLOSE for name, value in ours.items()), f"{ours} and {theirs}")


def set_by_hand(studio):
    """Every setting of a loop, then gains."""
    page = studio.page
    page.fill("#from", "190")
    page.fill("#to", "209")
    page.select_option("#style", "sharp")
    page.fill("#more", "--ms 1.9")
    studio.identify()
    studio.designed()
    page.fill("#exact-kp", str(0.9 * page.evaluate("gains.kp")))
    page.press("#exact-kp", "Enter")
    studio.until("!isAsking && drawn?.step_band !== undefined")


def nothing_set(studio, what):
    values = [studio.page.input_value(f"#{name}") for name in ("from", "to", "structure", "style", "more")]
    expect(not any(values), f"{what}: {values}")


def is_proposed(studio):
    studio.identify()
    studio.designed()
    expect(studio.page.evaluate("gains.kp === report.controller.kp"), "the sliders show the proposed gains")
    expect("kp=" not in studio.page.evaluate("location.hash"), "proposed gains are not kept as those of somebody")
    expect(studio.page.is_hidden("#origin"), "proposed gains do not come from the address")


def belongings(browser, told):
    """What is set by hand belongs to one loop of one recording: a reload, another file, loop or address does not move it."""
    studio = Studio(browser, told.page, **DESK)
    page = studio.page
    first, second = (str(told.repository / "examples/logs" / name) for name in ("px4_chirps.ulg", "ap_sysid_roll.bin"))
    studio.drop("log", first)
    page.select_option("#loop", "roll rate")
    studio.rest()
    set_by_hand(studio)
    kp, address = page.evaluate("gains.kp"), page.evaluate("location.hash")
    # Another recording in the same page, and after a reload.
    for reload in (False, True):
        if reload:
            studio.load(address)
        studio.drop("log", second)
        page.select_option("#loop", "roll rate")
        studio.rest()
        nothing_set(studio, f"another file, reload {reload}")
        is_proposed(studio)
        for button, options in (("#save-half", []), ("#save-whole", ["--step", "1"])):
            text, name = studio.saved(button)
            expect(name == "ap_sysid_roll_roll_rate.param", name)
            same_parameters(text, written(told, second, "roll", options))
    # The recording of the address gets them again, and says where they come from.
    studio.load(address)
    expect(page.is_hidden("#recording"), "there is no data in the address")
    studio.drop("log", first)
    expect(page.input_value("#loop") == "roll rate" and page.input_value("#style") == "sharp", "choices are kept")
    expect([page.input_value("#from"), page.input_value("#to")] == ["190", "209"], "the stretch is kept")
    studio.identify()
    studio.designed()
    expect(page.evaluate("gains.kp") == kp and page.is_visible("#origin")
           and page.inner_text("#calm-text") == "from the address", "gains from the address are called so")
    page.click("#proposed")
    expect(page.is_hidden("#origin"), "proposed gains do not come from the address")
    # Another loop, and back.
    for loop, axis in (("pitch rate", "pitch"), ("roll rate", "roll")):
        page.select_option("#loop", loop)
        studio.rest()
        expect(page.is_hidden("#result"), "another loop has no result")
        nothing_set(studio, loop)
        is_proposed(studio)
        text, name = studio.saved("#save-half")
        expect(name == f"px4_chirps_{axis}_rate.params", name)
        same_parameters(text, written(told, first, axis))
    # Forward and back between addresses.
    page.evaluate("location.hash = 'file=0&loop=roll+rate&flight=1&style=sharp&kp=9&ki=9&kd=9&filter_s=0'")
    studio.until("document.getElementById('state').textContent.includes('another recording')")
    page.go_back()
    page.wait_for_timeout(200)
    page.go_forward()
    page.wait_for_timeout(200)
    nothing_set(studio, "another address")
    expect("kp=9" not in page.evaluate("location.hash"), page.evaluate("location.hash"))
    studio.close()
    print("settings and gains: of one loop of one recording")


def outdated(browser, told):
    """A changed setting takes the result away; gains below the limits are saved after a question; no click is lost."""
    studio = Studio(browser, told.page, **DESK)
    page = studio.page
    studio.drop("log", str(told.repository / "examples/logs/px4_chirps.ulg"))
    page.select_option("#loop", "roll rate")
    studio.rest()
    for change in (lambda: page.select_option("#style", "calm"), lambda: page.type("#more", "--ms 1.3"), lambda: page.type("#to", "209"),
                   lambda: page.select_option("#structure", "toiptd"), lambda: page.click("#whole")):
        studio.identify()
        studio.designed()
        change()
        expect(page.is_hidden("#result") and page.is_hidden("#save-half") and page.is_hidden("#save-json"),
               "the result of other settings cannot be saved")
    page.select_option("#structure", "")
    page.fill("#more", "")
    # Changed while the library works.
    page.click("#identify")
    page.select_option("#style", "sharp")
    studio.rest()
    studio.until("document.getElementById('state').textContent.includes('press Identify')")
    expect(page.is_hidden("#result"), "the result of other settings is not shown")
    # Gains that break a limit of the style.
    studio.drop("log", str(told.repository / "examples/logs/ap_sysid_roll.bin"))
    page.select_option("#loop", "roll rate")
    studio.rest()
    studio.identify()
    studio.designed()
    proposed = page.evaluate("gains.kp")
    page.fill("#exact-kp", str(1.6 * proposed))
    page.press("#exact-kp", "Enter")
    studio.until("!isAsking && drawn?.step_band !== undefined")
    expect(page.evaluate("drawn.is_stable") and page.evaluate("drawn.figures.margins.ms") > 1.7, "sharp gains")
    for button in ("#save-whole", "#save-gains"):
        page.click(button)
        studio.until("document.getElementById('ask').open")
        question = page.inner_text("#ask-text")
        expect("Ms " in question and "at most 1.60" in question and "balanced" in question, question)
        if told.screenshots:
            page.screenshot(path=told.screenshots / "studio_question.png")
        page.click("#ask-no")
        studio.until("document.getElementById('exported').textContent === 'Not saved.'")
        page.click(button)
        studio.until("document.getElementById('ask').open")
        with page.expect_download():
            page.click("#ask-yes")
    # The old values are saved without a question.
    studio.saved("#save-restore")
    # A press on Identify straight from a field of a table: its columns are read anew.
    studio.drop("hover", str(told.repository / "examples/simulated_hover.csv"))
    studio.identify()
    for pause_ms in (0, 150):
        page.fill("#more", f"--cycles {7 + pause_ms // 100}")
        page.focus("#more")
        page.locator("#identify").scroll_into_view_if_needed()
        box = page.locator("#identify").bounding_box()
        page.mouse.move(box["x"] + 20, box["y"] + 10)
        page.mouse.down()
        page.wait_for_timeout(pause_ms)
        page.mouse.up()
        studio.until("!document.getElementById('result').hidden", limit_s=20)
        studio.rest()
    studio.close()
    print("changed settings, gains below the limits, the first click: as they should be")


def stretch(studio, told):
    """A stretch drawn with the mouse gives what --from and --to give; a survey; cancelling."""
    page = studio.page
    path = str(told.repository / "examples/logs/px4_chirps.ulg")
    studio.drop("log", path)
    page.select_option("#loop", "roll rate")
    studio.rest()
    # Until they are drawn.
    page.evaluate("reading")
    box = box_of(page, "#signals-0 svg")
    page.mouse.move(box["x"] + 0.2 * box["width"], box["y"] + 60)
    page.mouse.down()
    page.mouse.move(box["x"] + 0.5 * box["width"], box["y"] + 60, steps=4)
    page.mouse.move(box["x"] + 0.85 * box["width"], box["y"] + 60, steps=4)
    page.mouse.up()
    chosen = [page.input_value("#from"), page.input_value("#to")]
    expect(all(chosen) and float(chosen[1]) - float(chosen[0]) > 3.0, str(chosen))
    studio.identify()
    ours = json.loads(studio.saved("#save-json")[0])
    options = ["--axis", "roll", "--loop", "rate", "--from", chosen[0], "--to", chosen[1]]
    theirs = program(told.program, "identify", path, "--json", *options)
    alike = [(one["verdict"]["kind"], one["structure"]) for one in (ours, theirs)]
    expect(alike[0] == alike[1] and alike[0][0] == "identified", f"same stretch {chosen}: {alike}")
    page.click("#whole")
    page.click("#survey")
    studio.until("!document.getElementById('surveyed').hidden")
    page.click("#identify")
    page.evaluate("document.getElementById('cancel').click()")
    studio.until("document.getElementById('state').textContent === 'Cancelled.'")
    page.wait_for_timeout(500)
    studio.identify()
    expect(page.inner_text("#advice").startswith("Identified"), page.inner_text("#advice"))
    expect(page.inner_text("#verdict").split(":")[0] in ("CHANGE", "KEEP YOURS", "FIRST GAINS"), page.inner_text("#verdict"))
    print("stretch, survey, cancel: as they should be")


def answered(browser, told):
    """A dropped file is answered without a click: a table, and all loops of a flight, whose gains are saved at once."""
    studio = Studio(browser, told.page, is_automatic=True, viewport={"width": 1440, "height": 900})
    page = studio.page
    studio.drop("hover", str(told.repository / "examples/simulated_hover.csv"))
    studio.designed()
    expect(page.inner_text("#verdict").startswith("FIRST GAINS: "), page.inner_text("#verdict"))
    named = lambda: [row.split("\t") for row in page.inner_text("#named tbody").splitlines()]
    expect([row[0] for row in named()][:3] == ["Kp", "Ki", "Kd"], named())
    expect(not page.evaluate("document.getElementById('settings-panel').open"), "the settings are folded")
    for width, height in ((1440, 900), (1366, 657)):
        page.set_viewport_size({"width": width, "height": height})
        page.evaluate("scrollTo(0, 0)")
        in_sight(page, ("#verdict", "#named", "#calm", "#step svg", "#load svg"))
    # A flight: the card of the program, and the share of the work that is done.
    page.evaluate("""window.shares = []; new MutationObserver(() => { const { value } = document.getElementById("progress");
        if (document.getElementById("progress").hasAttribute("value")) shares.push([value, document.getElementById("state").textContent]); })
        .observe(document.getElementById("progress"), { attributes: true })""")
    log = str(told.repository / "examples/logs/px4_chirps.ulg")
    studio.drop("log", log)
    studio.until("document.getElementById('busy').hidden && !document.getElementById('design').hidden")
    studio.designed()
    survey = program(told.program, "identify", log, "--json")
    verdicts = {"change": "CHANGE", "keep": "KEEP YOURS", "first_gains": "FIRST GAINS", "not_yet": "NOT YET"}
    cards = page.locator("#surveyed .card")
    expect(cards.count() == len(survey["loops"]), f"{cards.count()} cards")
    for place, one in enumerate(survey["loops"]):
        text = cards.nth(place).inner_text()
        expect(text.startswith(one["name"]) and verdicts[one["answer"]["verdict"]] in text, text)
    shares = [share for share, work in page.evaluate("shares") if work == "Identifying loops."]
    expect(len(set(shares)) > 10 * len(survey["loops"]) and shares == sorted(shares) and max(shares) == 1, f"shares {shares}")
    # One loop has a share of its own.
    shares = [share for share, work in page.evaluate("shares") if work == "Identifying."]
    expect(len(set(shares)) > 10 and shares == sorted(shares) and max(shares) == 1, f"shares {shares}")
    first = next(one for one in survey["loops"] if one["answer"]["verdict"] == "change")
    expect(page.input_value("#loop") == first["name"], page.input_value("#loop"))
    now = {gain["name"]: gain for gain in first["answer"]["gains"]}
    for name, *values in named():
        for value, column in zip(values, ("now", "half", "full")):
            expect(abs(float(value) / now[name][column] - 1) < 2 * CLOSE, f"{name} {column} {value}, not {now[name][column]}")
    # What moves by hand has its name too.
    before = named()
    page.fill("#exact-kp", str(0.9 * page.evaluate("gains.kp")))
    page.press("#exact-kp", "Enter")
    studio.until("!isAsking && drawn?.step_band !== undefined")
    expect(named()[0][:2] == before[0][:2] and float(named()[0][3]) < float(before[0][3]), f"{before} and {named()}")
    ours, name = studio.saved("#save-all")
    path = told.scratch / "all.params"
    program(told.program, "identify", log, "--json", "--force", "--write", str(path))
    expect(name == "px4_chirps_all.params", name)
    same_parameters(ours, path.read_text(encoding="utf-8"))
    ours, name = studio.saved("#save-all-restore")
    expect(name == "px4_chirps_all.restore.params", name)
    same_parameters(ours, path.with_suffix(".restore.params").read_text(encoding="utf-8"))
    # Another loop by its card; a reload asks before gains are lost, and the address keeps them.
    page.locator("#surveyed button", has_text="pitch rate").click()
    studio.rest()
    studio.designed()
    expect(page.input_value("#loop") == "pitch rate", "the card opens its loop")
    expect(studio.questions == [], "no question without need")
    page.fill("#exact-kp", str(0.9 * page.evaluate("gains.kp")))
    page.press("#exact-kp", "Enter")
    studio.until("!isAsking && drawn?.step_band !== undefined")
    kept_over(studio, page.evaluate("gains.kp"))
    studio.close()
    refused(browser, told, log)
    # Before and after: the loop of one file beside that of the next.
    studio = Studio(browser, told.page, **DESK)
    page = studio.page
    studio.drop("hover", str(told.repository / "examples/simulated_hover.csv"))
    studio.identify()
    studio.designed()
    page.click("#keep-before")
    kept = page.evaluate("drawn.figures.margins.ms")
    studio.drop("roll", str(told.repository / "examples/jsbsim_f450_roll_clean.csv"))
    studio.identify()
    studio.designed()
    expect(page.inner_text("#against-head") == "simulated hover", page.inner_text("#against-head"))
    row = page.locator("#figures tbody tr").nth(4).locator("td").all_inner_texts()
    ours = page.evaluate("drawn.figures.margins.ms")
    expect([abs(float(cell) - ms) < 0.01 for cell, ms in zip(row, (ours, kept))] == [True, True], f"{row}, {ours} and {kept}")
    studio.close()
    # Gains as the controller of a plant takes them.
    studio = Studio(browser, told.page, **DESK)
    page, plant = studio.page, str(told.repository / "examples/plant/lic101_export.csv")
    studio.drop("plant", plant)
    page.fill("#more", "--controller pi")
    page.select_option("#vendor", "deltav")
    page.fill("#output-range", "0..100")
    studio.identify()
    studio.designed()
    theirs = program(told.program, "identify", plant, "--json", "--controller", "pi", "--vendor", "deltav", "--output-range", "0..100")
    gains = theirs["answer"]["gains"]
    rows = [row.split("\t") for row in page.inner_text("#named tbody").splitlines()]
    expect([row[0].split(" (")[0] for row in rows] == [gain["name"] for gain in gains], f"{rows} and {gains}")
    expect(all(abs(float(row[-1]) - gain["full"]) <= 2 * CLOSE * abs(gain["full"]) for row, gain in zip(rows, gains)), f"{rows} and {gains}")
    studio.close()
    # On a phone the responses stay in sight while the gains move.
    studio = Studio(browser, told.page, is_automatic=True, viewport={"width": 390, "height": 844}, is_mobile=True, has_touch=True)
    studio.drop("hover", str(told.repository / "examples/simulated_hover.csv"))
    studio.designed()
    studio.page.locator("#slide-kd").scroll_into_view_if_needed()
    studio.page.wait_for_timeout(600)
    in_sight(studio.page, ("#slide-kd", "#step svg", "#load svg"))
    studio.close()
    print("answers without a click, all loops, questions before a loss: as they should be")


def kept_over(studio, kp):
    """A reload, and the way to another page and back, keep the file, its loop and its gains without a question."""
    page = studio.page
    studio.until("keptFile === file")
    for way in (page.reload, lambda: (page.goto("about:blank"), page.go_back())):
        way()
        studio.until("document.body.dataset.readyMs !== undefined && typeof file === 'object'")
        studio.until("report !== undefined")
        studio.designed()
        expect(page.input_value("#loop") == "pitch rate" and page.evaluate("gains.kp") == kp, "the work after a reload")
        expect(page.is_visible("#origin") and page.is_hidden("#hint"), "gains of the address are called so")
        studio.until("keptFile === file")
    expect(studio.questions == [], f"no question where nothing is lost: {studio.questions}")
    # A new visit of the same tab begins anew.
    studio.load("")
    expect(page.evaluate("file === undefined"), "a new visit opens no file")


def refused(browser, told, log):
    """Where the browser keeps nothing, it asks before gains are lost, and the address keeps these."""
    studio = Studio(browser, told.page, is_automatic=True, **DESK)
    page = studio.page
    page.evaluate("indexedDB.open = () => { throw new Error('no room'); }, true")
    studio.drop("log", log)
    studio.until("document.getElementById('busy').hidden && !document.getElementById('design').hidden")
    studio.designed()
    page.fill("#exact-kp", str(0.9 * page.evaluate("gains.kp")))
    page.press("#exact-kp", "Enter")
    studio.until("!isAsking && drawn?.step_band !== undefined")
    kp = page.evaluate("gains.kp")
    page.reload()
    studio.until("document.body.dataset.readyMs !== undefined")
    expect(studio.questions == ["beforeunload"], f"a reload asks: {studio.questions}")
    studio.until("!document.getElementById('hint').hidden")
    studio.drop("log", log)
    studio.designed()
    expect(page.evaluate("gains.kp") == kp and page.is_visible("#origin"), "the gains of the address")
    studio.close()


def controllers(browser, told):
    """Gains under the names of a controller, in its ranges, without another press; copied and saved."""
    studio = Studio(browser, told.page, is_automatic=True, permissions=["clipboard-read", "clipboard-write"], viewport={"width": 1440, "height": 900})
    page = studio.page
    names = page.locator("#vendor option").all_text_contents()[1:]
    expect(len(names) == len(page.evaluate("vendors")) > 20 and {"klipper", "marlin", "pid-compact"} <= set(names), names)
    heater = str(told.repository / "examples/plant/tec_relay_run2.csv")
    studio.drop("heater", heater)
    studio.designed()
    for name, ranges in (("klipper", {"input": "0..255"}), ("marlin", {"input": "0..255"}), ("pid-compact", {"input": "0..255", "output": "0..500"}), ("isa", {"input": "0..255", "output": "0..500"})):
        page.select_option("#vendor", name)
        percent = page.evaluate("vendor().has_range_of_measurement")
        expect(page.is_visible("#output-range") == percent, f"{name}: the range of the measurement")
        options = ["--vendor", name]
        for which, value in ranges.items():
            if page.is_hidden(f"#{which}-range"):
                continue
            page.fill(f"#{which}-range", value)
            page.press(f"#{which}-range", "Enter")
            options += [f"--{which}-range", value]
        studio.rest()
        studio.until("!isBusy")
        theirs = program(told.program, "identify", heater, "--json", *options)
        if "answer" not in theirs:
            expect("range" in studio.state(), f"{name}: {studio.state()}")
            continue
        studio.until("report !== undefined")
        studio.designed()
        gains = theirs["answer"]["gains"]
        rows = [row.split("\t") for row in page.inner_text("#named tbody").splitlines()]
        expect([row[0].split(" (")[0] for row in rows] == [gain["name"] for gain in gains], f"{name}: {rows} and {gains}")
        expect(all(abs(float(row[-1]) - gain["full"]) <= SAME_GAINS * abs(gain["full"]) for row, gain in zip(rows, gains)), f"{name}: {rows} and {gains}")
        page.click("#copy")
        studio.until("document.getElementById('copied').textContent === 'Copied.'")
        copied = page.evaluate("navigator.clipboard.readText()")
        text, file = studio.saved("#save-text")
        expect(text == f"{copied}\n" and file == "tec_relay_run2.gains.txt", f"{file}: {text} and {copied}")
        expect(all(gain["name"] in text for gain in gains) or name == "marlin" and text.startswith("M301 P"), text)
    accessible(page)
    studio.close()
    print("controllers with gains of their own: as the program gives them")


def box_of(page, name):
    """Where this is on the screen, in one step of the page: between two of them a plot may be drawn anew, and the old one is nowhere."""
    return page.evaluate("(name) => document.querySelector(name).getBoundingClientRect().toJSON()", name)


def in_sight(page, names):
    """Checks that these are on the screen as it is."""
    width, height = page.evaluate("[innerWidth, innerHeight]")
    for name in names:
        box = box_of(page, name)
        seen = box["width"] > 0 and box["top"] >= 0 and box["bottom"] <= height and box["right"] <= width + 1
        expect(seen, f"{name} is at {box}")


def simulated(studio):
    """A relay test, a step and a chirp of processes of one's own."""
    page = studio.page
    page.evaluate("document.getElementById('simulate-panel').open = true")
    # Every process with the test that the page gives it.
    for process in page.locator("#s-process option").all_text_contents():
        page.select_option("#s-process", process)
        page.evaluate("signals = undefined")
        page.click("#simulate")
        studio.until("signals !== undefined || document.getElementById('state').className === 'bad'")
        studio.rest()
        studio.identify()
        expect(page.inner_text("#advice").startswith("Identified: "), f"{process}: {studio.state()} {page.inner_text('#advice')}")
    for process, excitation, more in [("soiptd", "relay", ""), ("foptd", "step", None), ("soptd", "prbs", "--pulse 10"),
                                      ("soiptd", "chirp", "--band 0.5,10 --loop 40,8")]:
        page.select_option("#s-process", process)
        page.select_option("#s-excitation", excitation)
        if more is not None:
            page.fill("#s-more", more)
        if excitation == "chirp":
            page.fill("#s-duration", "20")
        page.evaluate("signals = undefined")
        page.click("#simulate")
        studio.until("signals !== undefined")
        studio.rest()
        studio.identify()
        expect(page.inner_text("#advice").startswith(f"Identified: {process}, K"), f"{process}, {excitation}: {page.inner_text('#advice')}")
    page.select_option("#s-process", "soiptd")
    page.click("#expect")
    studio.until("!document.getElementById('expected').hidden")
    expect("expected 90 % interval" in page.inner_text("#expected"), page.inner_text("#expected"))
    page.fill("#s-parameters", "K=1, T_prop=-1")
    page.click("#simulate")
    studio.until("document.getElementById('state').className === 'bad'")
    print("simulations: identified")


def hostile(studio):
    """Files that are nothing, lie, or carry tags; each has one sentence, and the page goes on."""
    tags = "<img src=x onerror=alert(1)>"
    header = b"ULog\x01\x12\x35\x01" + bytes(8)
    cases = {
        "empty.csv": b"",
        "noise.bin": bytes((7 * k * k + k) % 256 for k in range(50_000)),
        "cut.ulg": header + b"\xff" * 5_000,
        "text.csv": b"time,input,output\n0,1,2\n1,x,3\n",
        "tags.csv": f"time,{tags},</script>\n".encode() + b"".join(b"%d,%d,nan\n" % (k, k) for k in range(50)),
        f"{tags}.csv": b"t,u,y\n" + b"".join(b"%g,1,1\n" % (0.01 * k) for k in range(500)),
    }
    for name, content in cases.items():
        studio.drop(name, content)
        if studio.page.is_visible("#signals"):
            studio.identify()
        said = studio.state() + studio.page.inner_text("#verdict")
        expect(len(said) > 20, f"{name}: {said}")
        expect(studio.page.locator("img").count() == 0, f"{name}: a tag of the file is on the page")
    studio.drop_with_mouse("plain.csv", "time,input,output\n" + "".join(f"{0.01 * k},{(k // 100) % 2},{math.sin(k)}\n" for k in range(1000)))
    expect("1,000 samples" in studio.state(), studio.state())
    print("hostile files: refused, each with a sentence")


def large(studio, told):
    """200 MB are read while the page goes on turning."""
    path = told.scratch / "large.csv"
    with open(path, "w", encoding="utf-8") as file:
        file.write("time_s,input,output\n")
        block = 100_000
        for start in range(0, 10**9, block):
            rows = (f"{k * 0.001:.3f},{1.0 if (k // 500) % 2 else -1.0},{math.sin(k * 0.00628):.17f}\n" for k in range(start, start + block))
            file.write("".join(rows))
            if file.tell() > 200_000_000:
                break
    studio.page.evaluate("""() => { window.longest = 0; let last = performance.now();
        window.turning = setInterval(() => { longest = Math.max(longest, performance.now() - last); last = performance.now(); }, 20); }""")
    studio.drop("large.csv", str(path))
    expect("samples" in studio.state(), studio.state())
    longest = studio.page.evaluate("clearInterval(turning), longest")
    expect(longest < 2000, f"the page stood still for {longest:.0f} ms")
    memory, size = studio.page.evaluate("memoryBytes") / 1e6, path.stat().st_size / 1e6
    expect(memory < 3 * size, f"{memory:.0f} MB of memory")
    print(f"{size:.0f} MB: {studio.state()}; memory of {memory:.0f} MB; the page stood still for at most {longest:.0f} ms")
    path.unlink()


def accessible(page):
    found = axe.violations(page)
    expect(not found, f"axe finds {found}")


def looks(browser, told):
    """Two widths and two themes: nothing is wider than the screen, nothing has no name."""
    for kind, screen in (("desk", DESK), ("phone", PHONE)):
        for theme in ("light", "dark"):
            studio = Studio(browser, told.page, color_scheme=theme, **screen)
            page = studio.page
            page.click("#example-flight")
            studio.until("!document.getElementById('recording').hidden && document.querySelector('#signals-0 svg')")
            studio.rest()
            page.select_option("#loop", "roll rate")
            studio.rest()
            studio.identify()
            studio.designed()
            wide = page.evaluate("document.documentElement.scrollWidth - innerWidth")
            expect(wide <= 0, f"{kind}: {wide} pixels wider than the screen")
            nameless = page.evaluate("""[...document.querySelectorAll("button, input, select, [role=img], iframe")].filter((one) =>
                !(one.textContent.trim() || one.ariaLabel || one.title || one.labels?.length)).map((one) => one.id)""")
            expect(not nameless, f"without a name: {nameless}")
            accessible(page)
            back = page.evaluate("getComputedStyle(document.body).backgroundColor")
            expect((back == "rgb(255, 255, 255)") == (theme == "light"), f"{theme}: {back}")
            page.click("#theme")
            expect(page.evaluate("getComputedStyle(document.body).backgroundColor") != back, "the button changes the theme")
            page.click("#theme")
            if told.screenshots:
                page.screenshot(path=told.screenshots / f"studio_{kind}_{theme}.png", full_page=True)
            studio.close()
    print("desk and phone, light and dark: as they should be")


def measure(browser, told):
    """Times on this machine; ratios to the program are taken side by side."""
    ready = []
    for _ in range(5):
        studio = Studio(browser, told.page, **DESK)
        ready.append(studio.page.evaluate("Number(document.body.dataset.readyMs)"))
        studio.close()
    print(f"ready after {statistics.median(ready):.0f} ms (median of 5); page of {told.page.stat().st_size / 1e6:.2f} MB")
    studio = Studio(browser, told.page, **DESK)
    for name, loop, options in FILES:
        path = told.repository / name
        studio.drop(path.name, str(path))
        if loop:
            studio.page.select_option("#loop", loop)
            studio.rest()
        pairs = []
        for _ in range(5):
            words = json.dumps(options)
            ours = studio.page.evaluate(f"""(async () => {{ const from = performance.now();
                await ask({{ do: "identify", options: {words} }}); return performance.now() - from; }})()""")
            began = time.monotonic()
            subprocess.run([told.program, "identify", str(path), "--json", *options], stdout=subprocess.DEVNULL, check=False)
            pairs.append((ours, 1000 * (time.monotonic() - began)))
        ours, theirs = (statistics.median(one) for one in zip(*pairs))
        print(f"{name}: {ours:.0f} ms in the page, {theirs:.0f} ms by the program on {os.cpu_count()} cores: {ours / theirs:.2f} times")
        if studio.page.evaluate("report = undefined, true") and name.endswith(("hover.csv", "chirps.ulg")):
            studio.identify()
            studio.designed()
            moves = [studio.page.evaluate(f"""(async () => {{ const from = performance.now();
                const answer = await ask({{ do: "judge", gains: {{ ...gains, kp: gains.kp * {1 + 0.01 * k} }} }});
                drawDesign(answer); document.body.offsetHeight; return performance.now() - from; }})()""") for k in range(30)]
            print(f"{name}: a slider's move is drawn after {statistics.median(moves):.0f} ms (largest of 30: {max(moves):.0f} ms)")
    studio.close()


# What each part needs: a window of its own, or the browser to open windows. The longest first.
PARTS = {
    "numbers": lambda browser, told: in_window(browser, told, numbers),
    "answered": answered,
    "belongings": belongings,
    "outdated": outdated,
    "controllers": controllers,
    "simulated": lambda browser, told: in_window(browser, told, lambda studio, _: simulated(studio)),
    "stretch": lambda browser, told: in_window(browser, told, stretch),
    "by_hand": lambda browser, told: in_window(browser, told, by_hand),
    "looks": looks,
    "large": lambda browser, told: in_window(browser, told, large),
    "hostile": lambda browser, told: in_window(browser, told, lambda studio, _: hostile(studio)),
}


def in_window(browser, told, part):
    studio = Studio(browser, told.page, **DESK)
    part(studio, told)
    studio.close()


def main():
    parser = argparse.ArgumentParser()
    for name in ("page", "program", "repository", "scratch"):
        parser.add_argument(name, type=pathlib.Path)
    parser.add_argument("--screenshots", type=pathlib.Path)
    parser.add_argument("--measure", action="store_true")
    parser.add_argument("--only", metavar="PART", choices=PARTS, help="runs one part of the tests, such as belongings")
    told = parser.parse_args()
    if not told.only and not told.measure:
        parallel.runs(PARTS)
        return
    told.page = told.page.resolve()
    with sync_playwright() as playwright, tempfile.TemporaryDirectory(dir=told.scratch) as scratch:
        told.scratch = pathlib.Path(scratch)
        browser = playwright.chromium.launch(executable_path=os.environ.get("CHROMIUM", "/usr/bin/chromium"), args=["--no-sandbox"])
        (measure if told.measure else PARTS[told.only])(browser, told)


if __name__ == "__main__":
    try:
        main()
    except Wrong as wrong:
        sys.exit(f"studio.py: {wrong}")
