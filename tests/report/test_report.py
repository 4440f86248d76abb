"""The report of a replay in a real browser: what is drawn, picked, turned and scrubbed, and that nothing is fetched.

CFODI_REPORT names an index.html (default: one is made); CFODI_SCREENSHOT says where the screenshot goes.
"""

import os
import pathlib

TOP = pathlib.Path(__file__).resolve().parents[2]
NOT_KNOWN = "not known"

# As WebDriver names them. Selenium is not imported here, so that the tests can say without it that they are left out.
LEFT, HOME, END = "\ue012", "\ue011", "\ue010"


def test_the_report_draws_the_map_and_shows_it(page):
    assert page.run("return cfodi.drawnPixels()") > 20_000
    assert int(page.run("return cfodi.moments")) > 1
    screenshot = pathlib.Path(os.environ.get("CFODI_SCREENSHOT", TOP / "target" / "report.png"))
    screenshot.parent.mkdir(parents=True, exist_ok=True)
    # On the cabinet recording, cluster 3 is the cabinet's top.
    page.click(*(page.a_place_of("3", below=0.25) or page.a_place_of())[:2])
    page.rest()
    assert page.browser.save_screenshot(str(screenshot))


def test_a_click_on_a_surface_shows_its_fields(page):
    x, y, cluster = page.a_place_of()
    before = page.picture()
    page.click(x, y)
    assert page.at("#chosen").get_attribute("data-id") == cluster
    assert page.at("#chosen h2").text == f"Cluster {cluster}"
    assert page.field("state") in ("tentative", "active", "complete")
    assert int(page.field("voxel_count").replace("\u202f", "")) > 0
    assert page.field("size").endswith(" m") and page.field("first_seen").endswith(" s")
    for later in ("surface_class", "area"):
        assert page.field(later) != ""
    assert page.picture() != before, "the chosen cluster is not shown"


def test_what_is_unknown_says_so(page_of_the_letter):
    page = page_of_the_letter
    page.at("#largest button").click()
    assert page.at("#chosen").get_attribute("data-id") != ""
    unknown = page.run("return [...document.querySelectorAll('#chosen .unknown')].map((field) => field.textContent)")
    assert set(unknown) == {NOT_KNOWN}
    texts = page.run("return [...document.querySelectorAll('#chosen dd')].map((field) => field.textContent)")
    assert not any(wrong in text for text in texts for wrong in ("NaN", "null", "undefined"))


def test_a_click_beside_the_map_lets_go(page):
    page.click(*page.a_place_of()[:2])
    page.click(3, 3)
    assert page.at("#chosen").get_attribute("data-id") == ""


def test_the_list_chooses_too(page):
    entry = page.at("#largest button")
    entry.click()
    chosen = page.at("#largest button[aria-pressed='true']")
    assert page.at("#chosen h2").text == f"Cluster {chosen.find_element('css selector', 'span:nth-of-type(2)').text}"


def test_the_list_chooses_what_was_pressed_though_time_goes_on_before_the_release(page):
    """As while the report plays."""
    page.run("cfodi.setTime(0)")
    line = page.at("#largest li:nth-child(2) button")
    cluster = line.find_element("css selector", "span:nth-of-type(2)").text
    page.press(line)
    page.run("for (let index = 1; index < cfodi.moments; index++) cfodi.setTime(index)")
    page.release()
    assert page.at("#chosen h2").text == f"Cluster {cluster}"


def test_time_goes_on_and_the_focus_stays(page):
    page.at("#largest button").click()
    for selector in ("#chosen header button", "#chosen summary", "#largest li:nth-child(2) button"):
        element = page.at(selector)
        page.run("arguments[0].focus(); cfodi.setTime(cfodi.moments - 3)", element)
        assert page.is_focused(element), selector
        page.run("cfodi.setTime(cfodi.moments - 1)")
        assert page.is_focused(element), selector


def test_the_chosen_cluster_is_said_once_and_not_at_each_moment(page):
    page.at("#largest button").click()
    at_moments, at_another = page.run("""
        const said = new MutationObserver(() => {});
        for (const live of document.querySelectorAll("[aria-live]"))
          said.observe(live, { childList: true, characterData: true, subtree: true });
        for (let index = 0; index < cfodi.moments; index++) cfodi.setTime(index);
        const atMoments = said.takeRecords().length;
        document.querySelector("#largest li:nth-child(2) button").click();
        return [atMoments, said.takeRecords().length];""")
    assert (at_moments, at_another) == (0, 1)


def test_after_a_cluster_is_let_go_the_focus_is_on_its_line(page):
    line = page.at("#largest li:nth-child(3) button")
    line.click()
    page.at("#chosen header button").click()
    assert page.at("#chosen").get_attribute("data-id") == ""
    assert page.is_focused(line)


def test_a_cluster_that_was_taken_in_leads_to_the_one_that_it_is_in(page):
    merge = page.run("return JSON.parse(document.getElementById('story').textContent).story.merges[0]")
    _, into, [taken_in, *_] = merge
    page.run("cfodi.choose(arguments[0])", taken_in)
    assert page.at("#chosen h2").text == f"Cluster {taken_in}"
    assert f"Taken in by cluster {into} " in page.at("#chosen p").text
    page.at("#chosen p button").click()
    assert page.at("#chosen h2").text == f"Cluster {into}"
    assert page.is_focused(page.at("#chosen header button"))


def test_dragging_turns_the_map_and_picks_nothing(page):
    x, y, _ = page.a_place_of()
    before = page.picture()
    page.drag(x, y, (90, -40))
    assert page.picture() != before
    assert page.at("#chosen").get_attribute("data-id") == ""


def test_arrow_keys_turn_the_map_and_home_shows_all_again(page):
    before = page.picture()
    page.canvas.send_keys(LEFT)
    turned = page.picture()
    assert turned != before
    page.canvas.send_keys(HOME)
    assert page.picture() == before


def test_all_that_is_shown_is_that_of_the_last_moment_whenever_it_is_asked_for(page):
    scale = page.run("return cfodi.camera.scale")
    page.run("cfodi.setTime(0)")
    before = page.picture()
    page.canvas.send_keys(LEFT, "+")
    page.at("#reset").click()
    assert page.run("return cfodi.camera.scale") == scale
    assert page.picture() == before, "it is still the first moment"


def test_scrubbing_changes_the_picture_and_the_time(page):
    slider = page.at("#time")
    before, shown = page.picture(), page.at("#shown").text
    for _ in range(3):
        slider.send_keys(LEFT)
    assert page.at("#shown").text != shown
    assert slider.get_attribute("aria-valuetext") == page.at("#shown").text
    assert page.picture() != before
    slider.send_keys(END)
    assert (page.picture(), page.at("#shown").text) == (before, shown)


def test_playing_runs_to_the_end(page):
    page.at("#time").send_keys(END, *[LEFT] * 2)
    page.at("#play").click()
    for _ in range(20):
        page.rest()
        if page.at("#play").get_attribute("aria-label") == "Play":
            break
    assert int(page.run("return document.getElementById('time').value")) == page.run("return cfodi.moments") - 1


def test_what_is_picked_is_what_is_seen_after_turning_and_zooming(page):
    page.drag(200, 200, (60, 30))
    for _ in range(4):
        page.canvas.send_keys("+")
    page.rest()
    x, y, cluster = page.a_place_of()
    page.click(x, y)
    assert page.at("#chosen").get_attribute("data-id") == cluster


def test_two_fingers_apart_zoom_in_and_pick_nothing(page):
    page.run("arguments[0].scrollIntoView()", page.canvas)
    before = page.run("return cfodi.camera.scale")
    page.pinch(40, 160)
    assert 3 < page.run("return cfodi.camera.scale") / before < 5
    assert page.at("#chosen").get_attribute("data-id") == ""


def test_nothing_is_fetched_and_nothing_goes_wrong(page):
    page.click(*page.a_place_of()[:2])
    page.drag(200, 200, (30, 30))
    page.at("#play").click()
    page.rest()
    assert page.requests() == []
    assert page.errors() == []


def test_the_report_of_an_empty_map_says_why_and_its_charts_have_an_axis(open_browser, empty_report):
    from viewer import Page
    page = Page(open_browser(), empty_report)
    axis = page.run("""
        const [chart] = [...document.querySelectorAll(".chart")].filter((one) => one.textContent.startsWith("Clusters"));
        return [...chart.querySelectorAll("text[text-anchor=end]")].map((text) => text.textContent);""")
    assert axis == ["0", "1"]
    text = page.at("body").text
    assert "hardly a point was used" in text and "out of range" in text
    assert page.errors() == []


def test_the_labels_of_an_axis_have_one_unit(page):
    axes = page.run("""
        const labels = (chart) => [...chart.querySelectorAll("text[text-anchor=end]")].map((text) => text.textContent);
        return [...document.querySelectorAll(".chart")].map(labels);""")
    units = [{label.partition(" ")[2] for label in axis if label != "0"} for axis in axes]
    assert len(units) == 4 and all(len(of_axis) == 1 for of_axis in units), axes


def test_in_a_narrow_window_nothing_is_cut_off(open_browser, made_report):
    from viewer import Page
    page = Page(open_browser(500, 900), made_report)
    assert page.run("return document.documentElement.scrollWidth <= document.documentElement.clientWidth")
    assert page.run("return cfodi.drawnPixels()") > 5_000


def test_when_its_window_gets_narrower_the_map_is_still_all_there(page):
    page.browser.set_window_size(600, 1000)
    page.rest()
    assert page.colours_of_the_border() == 1, "the map is cut off"
    narrow = page.picture()
    page.canvas.send_keys(HOME)
    assert page.picture() == narrow, "it fills the picture as one that was opened so"
    scale = page.run("return cfodi.camera.scale")
    page.canvas.send_keys(LEFT, "+")
    page.browser.set_window_size(1000, 700)
    page.rest()
    page.browser.set_window_size(600, 1000)
    page.rest()
    assert abs(page.run("return cfodi.camera.scale") / (1.2 * scale) - 1) < 1e-9, "what was zoomed stays zoomed"


def test_zoomed_almost_to_the_limit_the_map_is_as_large_as_before_when_its_window_was_wider_for_a_while(page):
    def scale(width):
        page.browser.set_window_size(width, 1000)
        page.rest()
        return page.run("return cfodi.camera.scale")

    scale(600)
    page.run("for (let i = 0; i < 100; i++) cfodi.camera.zoom(1.2)")
    page.run("cfodi.camera.zoom(0.99)")
    before, wide = scale(600), scale(1000)
    assert wide > before, "it grows up to the limit"
    assert abs(scale(600) / before - 1) < 1e-9


def test_voxels_in_no_cluster_stay_when_tentative_clusters_are_hidden(page):
    drawn, obstacles = page.run("return cfodi.drawnPixels()"), page.grey_pixels()
    assert obstacles > 500
    page.at("#small").click()
    page.rest()
    assert page.run("return cfodi.drawnPixels()") < drawn
    assert page.grey_pixels() > 0.95 * obstacles
