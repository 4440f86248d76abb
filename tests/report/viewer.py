"""The page in a browser, as a person at it would use it."""

import json
import time

from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.by import By
from selenium.webdriver.support.ui import WebDriverWait

# The picture is drawn finely when nothing has changed for 0.14 s.
AT_REST = 0.8


class Page:
    def __init__(self, browser, path):
        self.browser = browser
        browser.get(path.as_uri())
        WebDriverWait(browser, 60).until(lambda b: b.execute_script("return document.body.dataset.ready") == "true")
        self.canvas = self.at("#view")
        self.rest()

    def at(self, selector):
        return self.browser.find_element(By.CSS_SELECTOR, selector)

    def run(self, script, *arguments):
        return self.browser.execute_script(script, *arguments)

    def rest(self):
        time.sleep(AT_REST)

    def picture(self):
        """The pixels of the canvas, as text to be compared."""
        self.rest()
        return self.run("return document.getElementById('view').toDataURL()")

    def field(self, name):
        return self.at(f"#chosen [data-field='{name}']").text

    def a_place_of(self, cluster=None):
        """CSS px from the canvas's upper left corner where a cluster (that one) is seen."""
        return self.run("""
            const [wanted, canvas] = [arguments[0], document.getElementById("view")];
            for (let y = canvas.clientHeight * 0.5 | 0; y < canvas.clientHeight; y += 3)
              for (let x = 10; x < canvas.clientWidth; x += 3) {
                const id = cfodi.pick(x, y);
                if (id !== null && (wanted === null || id === wanted)) return [x, y, id];
              }
            return null;""", cluster)

    def mouse(self, x, y):
        """Moves the mouse to CSS px from the canvas's upper left corner."""
        box = self.canvas.rect
        return ActionChains(self.browser, duration=50).move_to_element_with_offset(
            self.canvas, int(x - box["width"] // 2), int(y - box["height"] // 2))

    def click(self, x, y):
        self.mouse(x, y).click().perform()

    def drag(self, x, y, by):
        self.mouse(x, y).click_and_hold().move_by_offset(*by).release().perform()

    def errors(self):
        return [entry for entry in self.browser.get_log("browser") if entry["level"] in ("SEVERE", "WARNING")]

    def requests(self):
        """The addresses asked for, those within the page itself left out."""
        events = (json.loads(entry["message"])["message"] for entry in self.browser.get_log("performance"))
        sent = (event["params"]["request"]["url"] for event in events if event["method"] == "Network.requestWillBeSent")
        return [url for url in sent if not url.startswith("data:")]
