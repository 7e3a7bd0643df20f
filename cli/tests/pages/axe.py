"""What axe-core finds that stands in the way of a screen reader."""

import importlib.util
import pathlib


def violations(page):
    """Rule and element of each violation. Without the package, which requirements.txt names, none, and a line says that it was not
    looked for."""
    found = importlib.util.find_spec("axe_playwright_python")
    if found is None:
        print("axe-playwright-python is not installed: accessibility is not looked for")
        return []
    page.evaluate((pathlib.Path(found.origin).parent / "axe.min.js").read_text(encoding="utf-8"))
    # Plotly's drawings have a label each; what they consist of is looked at by the tests of the plots, and would take ten seconds.
    return page.evaluate("""axe.run({ exclude: ".plot svg" }, { resultTypes: ["violations"] })
        .then(({ violations }) => violations.map(({ id, nodes }) => `${id}: ${nodes[0].html}`))""")
