"""Open reports in Debian's Chromium, as on a telephone, on a desk and on paper, and say what is
wrong.

``make test-report`` runs it, outside the image; it installs Chromium and poppler-utils where it
may. It checks
that nothing scrolls sideways but folded tables, and on a telephone tables and broad pictures, and
that the print is no wider than the paper and has at most four pages, none of which ends with a
heading.

    python3 tests/support/in_chromium.py PAGE.html ...     leaves pictures of what it saw beside
    each page
"""

import html
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

WIDTHS = (390, 1280)
TELEPHONE = 600  # pixels, up to which tables may scroll
PAPER = 688  # pixels between the margins of the print, 182 mm
PAGES = range(1, 5)
# So that it neither needs a profile nor a network.
OPTIONS = (
    *(
        "--headless",
        "--no-sandbox",
        "--disable-gpu",
        "--disable-quic",
        "--no-first-run",
        "--hide-scrollbars",
    ),
    *(
        "--disable-background-networking",
        "--disable-component-update",
        "--disable-sync",
        "--virtual-time-budget=5000",
    ),
)
WATCH = (
    "<script>var failures = []; window.onerror = function (text) { failures.push(text); };</script>"
)
LOOK = """<script>
window.addEventListener("load", function () {
  var wide = Array.from(document.querySelectorAll("body *")).filter(function (one) {
    return one.getBoundingClientRect().right > innerWidth + 1 && !one.closest(".scroll, figure.broad, details, pre");
  });
  var tables = Array.from(document.querySelectorAll(".scroll")).filter(function (one) {
    return one.scrollWidth > one.clientWidth + 1 && !one.closest("details");
  });
  var small = Array.from(document.querySelectorAll("td, dd, p, li, figcaption")).filter(function (one) {
    return one.offsetParent && parseFloat(getComputedStyle(one).fontSize) < 12;
  });
  var found = { width: innerWidth, across: document.documentElement.scrollWidth, failures: failures,
    wide: wide.slice(0, 3).map(function (one) { return one.outerHTML.slice(0, 80); }), small: small.length,
    tables: tables.map(function (one) { return one.querySelector("th").textContent; }),
    headings: Array.from(document.querySelectorAll("h2")).map(function (one) { return one.textContent; })
  };
  parent.postMessage(JSON.stringify(found), "*");
});
</script>"""
# A window of Chromium cannot be as narrow as a telephone, a frame can.
FRAME = """<!DOCTYPE html><body style="margin:0">
<iframe src="{name}" width="{width}" height="{height}" style="border:0"></iframe>
<pre id="found"></pre><script>window.onmessage = function (event) {{
  document.getElementById("found").textContent = event.data; }};</script></body>"""
HEIGHT = 6000


def tools():
    """Install what is missing, as root on Debian.

    Raises:
        SystemExit: it cannot be installed here.
    """
    needed = {"chromium": "chromium", "poppler-utils": "pdftotext"}
    missing = [package for package, tool in needed.items() if not shutil.which(tool)]
    if not missing:
        return
    if os.geteuid() or not shutil.which("apt-get"):
        sys.exit(f"test-report needs {' and '.join(missing)}: install them")
    quiet = {
        "stdout": subprocess.DEVNULL,
        "env": {**os.environ, "DEBIAN_FRONTEND": "noninteractive"},
    }
    subprocess.run(["apt-get", "update", "-q"], check=True, **quiet)
    subprocess.run(
        ["apt-get", "install", "-qy", "--no-install-recommends", *missing], check=True, **quiet
    )


def chromium(page, *options):
    """Its standard output for a page, in a profile of its own."""
    with tempfile.TemporaryDirectory() as profile:
        command = [
            "chromium",
            *OPTIONS,
            f"--user-data-dir={profile}",
            *options,
            page.resolve().as_uri(),
        ]
        return subprocess.run(
            command, capture_output=True, text=True, check=True, timeout=300
        ).stdout


def looked_at(page, width, as_printed=False):
    """What LOOK found in a frame of this width, on the screen or in the style of the print, and a
    picture of it.
    """
    source = page.read_text(encoding="utf-8")
    if as_printed:
        source = source.replace("@media print", "@media all").replace(
            "@media screen", "@media speech"
        )
    picture = page.with_name(f"{page.stem}-{'print' if as_printed else width}.png")
    with tempfile.TemporaryDirectory() as folder:
        copy, plain, frame = (
            Path(folder) / name for name in ("watched.html", "plain.html", "frame.html")
        )
        watched = source.replace("<head>", f"<head>{WATCH}", 1).replace("</body>", f"{LOOK}</body>")
        copy.write_text(watched, encoding="utf-8")
        frame.write_text(FRAME.format(name=copy.name, width=width, height=HEIGHT), encoding="utf-8")
        seen = chromium(frame, "--window-size=1400,900", "--dump-dom")
        plain.write_text(source, encoding="utf-8")
        frame.write_text(
            FRAME.format(name=plain.name, width=width, height=HEIGHT), encoding="utf-8"
        )
        chromium(
            frame, f"--window-size={max(width, 500)},{HEIGHT}", f"--screenshot={picture.resolve()}"
        )
    return json.loads(
        html.unescape(re.search(r'<pre id="found">(.*?)</pre>', seen, flags=re.DOTALL)[1])
    )


def problems_on_screen(page, width):
    """What is wrong in a window of this width."""
    found = looked_at(page, width)
    checks = {
        f"the window has {found['width']} pixels": found["width"] == width,
        f"the page is {found['across']} pixels wide: {found['wide']}": found["across"] <= width
        and not found["wide"],
        f"scripts fail: {found['failures']}": not found["failures"],
        f"{found['small']} texts of less than 12 pixels": found["small"] == 0,
        f"wider than the page: the tables of {found['tables']}": width < TELEPHONE
        or not found["tables"],
    }
    return [f"{width} pixels: {what}" for what, good in checks.items() if not good], found


def problems_in_print(page, headings):
    """What is wrong on paper."""
    paper = page.with_suffix(".pdf")
    chromium(page, "--no-pdf-header-footer", f"--print-to-pdf={paper.resolve()}")
    boxes = subprocess.run(
        ["pdftotext", "-bbox-layout", str(paper), "-"], capture_output=True, text=True, check=True
    )
    pages = boxes.stdout.split("<page ")[1:]
    wrong = [] if len(pages) in PAGES else [f"print: {len(pages)} pages"]
    across = looked_at(page, PAPER, as_printed=True)["across"]
    if across > PAPER:
        wrong.append(f"print: {across} pixels wide, there is place for {PAPER}")
    for number, text in enumerate(pages, start=1):
        lines = [
            (
                float(bottom),
                " ".join(html.unescape(word) for word in re.findall(r">([^<]*)</word>", line)),
            )
            for bottom, line in re.findall(
                r'<line [^>]*yMax="([^"]*)">(.*?)</line>', text, flags=re.DOTALL
            )
        ]
        if lines and max(lines)[1] in headings:
            wrong.append(f"print: page {number} ends with the heading {max(lines)[1]!r}")
    return wrong


def main(pages):
    tools()
    failed = False
    for page in pages:
        wrong = []
        for width in WIDTHS:
            here, found = problems_on_screen(page, width)
            wrong += here
        wrong += problems_in_print(page, set(found["headings"]))
        print(f"{page}: {'; '.join(wrong) or 'good'}")
        failed |= bool(wrong)
    return int(failed)


if __name__ == "__main__":
    sys.exit(main([Path(name) for name in sys.argv[1:]]))
