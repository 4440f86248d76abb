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
        # On a busy machine the page's timers may be late: this one is due after those that were set before it.
        self.browser.execute_async_script("requestAnimationFrame(() => setTimeout(arguments[0], 200))")

    def picture(self):
        """The pixels of the canvas, as text to be compared."""
        self.rest()
        return self.run("return document.getElementById('view').toDataURL()")

    def colours_of_the_border(self):
        """How many colours the pixels of the canvas's first and last column have."""
        return self.run("""
            const canvas = document.getElementById("view");
            const column = (x) => canvas.getContext("2d").getImageData(x, 0, 1, canvas.height).data;
            return new Set([0, canvas.width - 1].flatMap((x) => [...new Uint32Array(column(x).buffer)])).size;""")

    def grey_pixels(self):
        """Pixels of what is in no cluster."""
        return self.run("""
            const { width, height } = document.getElementById("view");
            const { data } = document.getElementById("view").getContext("2d").getImageData(0, 0, width, height);
            let count = 0;
            for (let at = 0; at < data.length; at += 4) {
              const [least, most] = [Math.min, Math.max].map((of) => of(...data.subarray(at, at + 3)));
              count += least > 60 && most < 200 && most - least < 3;
            }
            return count;""")

    def field(self, name):
        return self.at(f"#chosen [data-field='{name}']").text

    def a_place_of(self, cluster=None, below=0.5):
        """CSS px from the canvas's upper left corner where a cluster (that one) is seen, this share of the canvas down or
        further."""
        return self.run("""
            const [wanted, below, canvas] = [...arguments, document.getElementById("view")];
            for (let y = canvas.clientHeight * below | 0; y < canvas.clientHeight; y += 3)
              for (let x = 10; x < canvas.clientWidth; x += 3) {
                const id = cfodi.pick(x, y);
                if (id !== null && (wanted === null || id === wanted)) return [x, y, id];
              }
            return null;""", cluster, below)

    def mouse(self, x, y):
        """Moves the mouse to CSS px from the canvas's upper left corner."""
        box = self.canvas.rect
        return ActionChains(self.browser, duration=50).move_to_element_with_offset(
            self.canvas, int(x - box["width"] // 2), int(y - box["height"] // 2))

    def click(self, x, y):
        self.mouse(x, y).click().perform()

    def press(self, element):
        """The mouse's button stays down until it is released."""
        ActionChains(self.browser, duration=50).click_and_hold(element).perform()

    def release(self):
        ActionChains(self.browser).release().perform()

    def is_focused(self, element):
        return self.run("return document.activeElement === arguments[0]", element)

    def drag(self, x, y, by):
        self.mouse(x, y).click_and_hold().move_by_offset(*by).release().perform()

    def pinch(self, apart, then):
        """Two fingers about the middle of the picture, so many CSS px apart and then so many."""
        box = self.run("const b = arguments[0].getBoundingClientRect(); return [b.x + b.width / 2, b.y + b.height / 2]",
                       self.canvas)
        for kind, distance in (("touchStart", apart), ("touchMove", (apart + then) / 2), ("touchMove", then)):
            fingers = [{"x": box[0] + side * distance / 2, "y": box[1], "id": i} for i, side in enumerate((-1, 1))]
            self.browser.execute_cdp_cmd("Input.dispatchTouchEvent", {"type": kind, "touchPoints": fingers})
        self.browser.execute_cdp_cmd("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
        self.rest()

    def errors(self):
        return [entry for entry in self.browser.get_log("browser") if entry["level"] in ("SEVERE", "WARNING")]

    def requests(self):
        """The addresses that the page asked for, its own and those within it left out."""
        events = (json.loads(entry["message"])["message"] for entry in self.browser.get_log("performance"))
        sent = [event["params"] for event in events if event["method"] == "Network.requestWillBeSent"]
        own = self.browser.current_url
        addresses = [request["request"]["url"] for request in sent if request["documentURL"] == own]
        assert own in addresses, "requests are not recorded"
        return [url for url in addresses if url != own and not url.startswith("data:")]
