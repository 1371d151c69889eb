"""view.py OVOID [FOLDER]: a page in a headless Chromium. It loads without a complaint and without the
network, each view is another picture, and pointer and keys do what the page says. With a FOLDER its
screenshots stay there."""

import json
import os
import sys
import tempfile

import browser
from inputs import Page, make, need_device, run, skip

tool = os.path.abspath(sys.argv[1])
keep = os.path.abspath(sys.argv[2]) if len(sys.argv) > 2 else None
VIEWS = ["molecule", "model", "both", "difference", "ellipsoids"]
WIDTH, HEIGHT = 480, 360


def differing(a, b):
    """The share of pixels that are not alike."""
    assert a[:2] == b[:2]
    x, y = a[2], b[2]
    count = sum(1 for i in range(0, len(x), 3)
                if abs(x[i] - y[i]) + abs(x[i + 1] - y[i + 1]) + abs(x[i + 2] - y[i + 2]) > 24)
    return 3 * count / len(x)


def share(picture, test):
    """Of the pixels above the controls, those that are so."""
    data = picture[2][:3 * picture[0] * (picture[1] * 2 // 3)]
    return sum(1 for i in range(0, len(data), 3) if test(*data[i:i + 3])) / (len(data) / 3)


def is_blue(r, g, b):
    return b > r + 30


def is_red(r, g, b):
    return r > b + 30


def ready(b, path, fragment=""):
    b.open(path, fragment)
    b.wait("document.getElementById('canvas').dataset.ready")
    assert b.ask("document.getElementById('message').hidden")
    b.settle()


def shown(b, view, level=0):
    b.wait("document.getElementById('canvas').dataset.view === '%s' && "
           "document.getElementById('canvas').dataset.level === '%d'" % (view, level))
    b.settle()


def picture(b, name):
    return b.screenshot(os.path.join(keep, name + ".png") if keep else None)


def check_views(b):
    pictures = {}
    for number, view in enumerate(VIEWS, 1):
        b.key(str(number))
        shown(b, view)
        assert b.ask("document.querySelector('[role=radio][aria-checked=true]').textContent") == view
        assert b.ask("document.getElementById('legend').hidden") == (view != "difference")
        pictures[view] = picture(b, view)
    for i, one in enumerate(VIEWS):
        for other in VIEWS[i + 1:]:
            assert differing(pictures[one], pictures[other]) > 0.03, (one, other)
    p = pictures
    assert share(p["molecule"], is_red) > 0.1 and share(p["molecule"], is_blue) < 0.01
    assert share(p["model"], is_blue) > 0.1 and share(p["model"], is_red) < 0.01
    assert share(p["difference"], is_red) > 0.01 and share(p["difference"], is_blue) > 0.01
    return pictures


def check_turning(b, first):
    b.drag(240, 160, 90, 30)
    b.settle()
    turned = b.screenshot()
    assert differing(first, turned) > 0.03, "a drag turns it"
    for key in ("ArrowLeft", "q", "+"):
        b.key(key)
        b.settle()
        before, turned = turned, b.screenshot()
        assert differing(before, turned) > 0.01, key
    b.mouse("mouseWheel", 240, 160, deltaX=0, deltaY=400)
    b.settle()
    assert share(b.screenshot(), is_red) < share(turned, is_red), "the wheel makes it smaller"
    b.key("r")
    b.settle()
    assert differing(first, b.screenshot()) == 0, "R brings it back"


def drawn(picture):
    """Points of what is drawn, with some of it about them, from the middle of the page outward."""
    width, height, data = picture
    paper = data[3 * (5 * width + 240):][:3]

    def is_drawn(x, y):
        at = 3 * (y * width + x)
        return sum(abs(a - b) for a, b in zip(data[at:at + 3], paper)) > 60

    return sorted(((x, y) for y in range(70, 230) for x in range(60, width - 60)
                if all(is_drawn(x + dx, y + dy) for dx in (-4, 0, 4) for dy in (-4, 0, 4))),
                  key=lambda p: (p[0] - width / 2) ** 2 + (p[1] - 160) ** 2)


def card(b):
    return b.ask("document.getElementById('card').hidden ? '' : document.getElementById('card').innerText")


def check_picking(b, page):
    """Pointed at in the middle of the picture, an ellipsoid tells what the model says of it."""
    b.key("5")
    shown(b, "ellipsoids")
    b.mouse("mouseMoved", 3, 180)
    b.settle()
    assert card(b) == ""
    plain = b.screenshot()
    points = drawn(plain)
    x, y = points[0]
    b.mouse("mouseMoved", x, y)
    b.settle()
    text, pointed = card(b), b.screenshot()
    assert text.startswith("Ellipsoid "), text
    number = int(text.split()[1])
    record = page.ellipsoids(0)[number - 1]
    names = json.loads(page.block(page.scene["levels"][0]["names"]))
    assert "%d" % record[13] in text and " × ".join(
        "%.2f" % s for s in sorted(record[3:6], reverse=True)) in text, text
    assert names[number - 1].split(", ")[0] in text
    assert 0.002 < differing(plain, pointed) < 0.5, "it is marked, and it alone"
    yellow = share(pointed, lambda r, g, b: r > b + 80 and g > b + 50)
    assert yellow > 0.001
    clear = [p for p in points if p[0] > 240] # beside the card
    for far in range(1, 9): # what is pointed at is what is seen there
        other = clear[far * (len(clear) - 1) // 8]
        b.mouse("mouseMoved", *other)
        b.settle()
        seen, at = b.screenshot(), 3 * (other[1] * plain[0] + other[0])
        if card(b): # at the rim, a pixel can be half covered
            red, _, blue = seen[2][at:at + 3]
            assert red > blue + 40, (other, seen[2][at:at + 3])
        else:
            assert seen[2][at:at + 3] == plain[2][at:at + 3]
    b.click(x, y)
    b.mouse("mouseMoved", 3, 180)
    assert card(b) == text, "a click keeps it"
    b.key("Escape")
    assert card(b) == ""
    b.key("n")
    assert card(b).startswith("Ellipsoid 1\n")
    b.key("p")
    assert card(b).startswith("Ellipsoid %d\n" % len(names))
    b.key("Escape")


def difference_at(b, x, y):
    """What the page says of the place that is seen there, Å; None where it says nothing."""
    b.mouse("mouseMoved", x, y)
    b.settle()
    text = card(b)
    if not text:
        return None
    value = float(text.split(" Å")[0].removeprefix("more than ").replace("−", "-"))
    said = "meet here" if value == 0 else "outside here" if value > 0 else "inside here"
    assert said in text, text
    return value


def check_places(b, page):
    """Pointed at, a place of the difference tells how far it is off: what its colour says."""
    b.key("r")
    b.key("4")
    shown(b, "difference")
    b.mouse("mouseMoved", 3, 180)
    b.settle()
    assert card(b) == "" and b.ask("document.getElementById('mark').hidden")
    plain = b.screenshot()
    points = [p for p in drawn(plain) if p[0] > 10]
    values, hues, limit = [], [], page.scene["range"]
    for k in range(60):
        x, y = points[k * (len(points) - 1) // 59]
        value = difference_at(b, x, y)
        if value is None:  # between two pieces
            continue
        at = 3 * (y * plain[0] + x)
        red, green, blue = plain[2][at:at + 3]
        assert abs(value) <= limit + 0.005
        values.append(value)
        hues.append((red - blue) / (red + green + blue))
    assert len(values) > 50 and min(values) < -0.2 * limit and max(values) > 0.2 * limit, values
    assert correlation(values, hues) > 0.93, correlation(values, hues)
    left = float(b.ask("document.getElementById('mark').style.left").rstrip("%"))
    assert abs(left - 50 - 50 * values[-1] / limit) < 2
    check_kept_place(b, points[0])


def correlation(a, b):
    n, mean_a, mean_b = len(a), sum(a) / len(a), sum(b) / len(b)
    spread = [sum((v - m) ** 2 for v in c) for c, m in ((a, mean_a), (b, mean_b))]
    return sum((a[i] - mean_a) * (b[i] - mean_b) for i in range(n)) / (spread[0] * spread[1]) ** 0.5


def dot(b):
    return b.ask("""(() => { const d = document.getElementById('dot');
        return d.hidden ? null : [parseFloat(d.style.left), parseFloat(d.style.top)]; })()""")


def check_kept_place(b, at):
    """A click keeps a place; its dot goes along with it as the molecule is turned."""
    value = difference_at(b, *at)
    b.click(*at)
    b.settle()
    first = dot(b)
    assert abs(first[0] - at[0]) < 1.5 and abs(first[1] - at[1]) < 1.5, (first, at)
    b.mouse("mouseMoved", 3, 180)
    b.settle()
    kept = card(b)
    assert kept, "a click keeps it"
    b.key("ArrowRight")
    b.settle()
    second = dot(b)
    assert second is None or abs(second[0] - first[0]) > 2, "it moves"
    if second:
        assert abs(difference_at(b, *second) - value) < 0.03, "and is the same place"
    for _ in range(24):  # to the other side
        b.key("ArrowRight")
    b.settle()
    assert dot(b) is None
    b.key("Escape")
    b.mouse("mouseMoved", 3, 180)
    b.settle()
    assert card(b) == ""
    b.key("r")


def check_levels(b):
    b.key("2")
    shown(b, "model")
    fine = b.screenshot()
    b.key("l")
    shown(b, "model", 1)
    assert differing(fine, b.screenshot()) > 0.01, "another level is another surface"
    assert b.ask("document.getElementById('level').value") == "1"
    b.key("l")
    shown(b, "model", 0)
    b.key("d")
    b.wait("document.getElementById('detail').value === '1'")
    b.settle()
    assert differing(fine, b.screenshot()) < 0.2
    b.ask("document.getElementById('keys').click()")
    assert not b.ask("document.getElementById('help').hidden")
    b.key("Escape")
    assert b.ask("document.getElementById('help').hidden")
    b.ask("document.querySelector('[data-view=both]').click()")
    shown(b, "both")


def check_names(b):
    """Whoever hears the page rather than sees it: each control has a name."""
    tree = b.call("Accessibility.getFullAXTree")["nodes"]
    controls = [(n["role"]["value"], n.get("name", {}).get("value", "")) for n in tree
                if n.get("role", {}).get("value") in ("button", "radio", "combobox", "image", "radiogroup")]
    roles = [role for role, _ in controls]
    assert roles.count("radio") == 5 and roles.count("button") == 3 and roles.count("combobox") == 2, controls
    assert all(name for _, name in controls), controls


def check_phone(b, path):
    b.resize(390, 700, mobile=True, dark=True)
    ready(b, path, "#difference")
    shown(b, "difference")
    dark = picture(b, "phone")
    assert share(dark, lambda r, g, b: r + g + b < 120) > 0.3, "a dark page"
    assert b.ask("document.documentElement.scrollWidth <= 390")
    outside = b.ask("[...document.querySelectorAll('button, select')].filter((e) => { const r = "
                    "e.getBoundingClientRect(); return r.width && (r.left < 0 || r.right > 390 || "
                    "r.bottom > 700); }).length")
    assert outside == 0, "controls beyond the window"
    b.key("t")
    b.settle()
    assert share(b.screenshot(), lambda r, g, b: r + g + b > 600) > 0.3, "a light page"


if not browser.find():
    skip("no program chromium here (Debian: chromium)")
need_device(tool)
with tempfile.TemporaryDirectory() as folder:
    pdb, model, coarse = make(tool, folder)
    path = os.path.join(folder, "view.html")
    run(tool, "export", pdb, model, coarse, "-o", path, "--spacing", "0.6")
    page = Page(path)
    with browser.Browser(WIDTH, HEIGHT) as b:
        ready(b, path)
        shown(b, "both")
        check_names(b)
        pictures = check_views(b)
        b.key("1")
        shown(b, "molecule")
        check_turning(b, pictures["molecule"])
        check_picking(b, page)
        check_places(b, page)
        check_levels(b)
        assert b.complaints() == [], b.complaints()
        check_phone(b, path)
        assert b.complaints() == [], b.complaints()
        b.call("Page.addScriptToEvaluateOnNewDocument",
               source="HTMLCanvasElement.prototype.getContext = () => null;")
        b.open(path)
        b.wait("document.getElementById('message').textContent.includes('needs WebGL 2')")
print("a page shows the scene")
