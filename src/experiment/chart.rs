//! Charts as SVG: one panel or several beside each other, with the legend above where it hides nothing.
//!
//! The background is white, so that a chart also reads on a dark page. The same numbers give the same text.

use plotters::backend::SVGBackend;
use plotters::coord::Shift;
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

/// Points of a series beyond which only some are drawn: a picture is no wider.
const MOST_POINTS: usize = 800;
/// Height of the title with the legend below it (px).
const HEAD: u32 = 62;
/// Width of a letter, of the size of its font as this library counts it.
const LETTER: f64 = 0.47;
const INK: RGBColor = RGBColor(40, 40, 40);
const FAINT: RGBColor = RGBColor(130, 130, 130);
const GRID: RGBColor = RGBColor(225, 225, 225);
const FONT: &str = "sans-serif";
/// What is drawn for an extent of nothing.
const NO_DATA: &str = "no data";

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Context<'a, 'b> = ChartContext<'a, SVGBackend<'b>, Cartesian2d<RangedCoordf64, RangedCoordf64>>;
type Drawn = Result<(), Box<dyn std::error::Error>>;

/// How a series is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Style {
    Line,
    Dashed,
    /// Below the others.
    Broad,
    /// A line with its points marked.
    Marked,
    Dots,
}

#[derive(Clone, Debug)]
pub(super) struct Series {
    /// In the legend; none where it is empty.
    pub(super) name: String,
    /// sRGB.
    pub(super) colour: [u8; 3],
    pub(super) style: Style,
    /// Those that are not finite are left out.
    pub(super) points: Vec<(f64, f64)>,
}

/// One panel. Its y axis begins at 0.
#[derive(Clone, Debug, Default)]
pub(super) struct Panel {
    /// Above the panel; none where it is empty.
    pub(super) title: String,
    /// With the unit.
    pub(super) x: String,
    /// With the unit.
    pub(super) y: String,
    pub(super) series: Vec<Series>,
    /// A value of x to be marked by a vertical line.
    pub(super) mark: Option<f64>,
}

/// The chart of these panels, in two columns where they are more than one.
pub(super) fn svg(title: &str, legend: &[Series], panels: &[Panel]) -> String {
    let rows = panels.len().div_ceil(2).max(1);
    let size = if panels.len() > 1 { (960, HEAD + 270 * rows as u32) } else { (820, HEAD + 380) };
    let mut text = String::new();
    let drawn = {
        let area = SVGBackend::with_string(&mut text, size).into_drawing_area();
        draw(&area, title, legend, panels)
    };
    // Fixed sizes, finite extents that are not empty, and memory to write to: there is nothing left that could fail.
    drawn.unwrap_or_else(|error| unreachable!("a chart in memory: {error}"));
    text
}

fn draw(area: &Area, title: &str, legend: &[Series], panels: &[Panel]) -> Drawn {
    area.fill(&WHITE)?;
    let (head, body) = area.split_vertically(HEAD);
    draw_head(&head, title, legend)?;
    let columns = if panels.len() > 1 { 2 } else { 1 };
    let places = body.split_evenly((panels.len().div_ceil(columns).max(1), columns));
    for (place, panel) in places.iter().zip(panels) {
        draw_panel(place, panel)?;
    }
    area.present()?;
    Ok(())
}

fn draw_head(area: &Area, title: &str, legend: &[Series]) -> Drawn {
    let left = Pos::new(HPos::Left, VPos::Center);
    let bold = (FONT, 22).into_font().style(FontStyle::Bold).color(&INK).pos(left);
    area.draw(&Text::new(title.to_owned(), (16, 20), bold))?;
    let (mut x, y) = (18, 48);
    for series in legend.iter().filter(|series| !series.name.is_empty()) {
        let colour = rgb(series.colour);
        match series.style {
            Style::Line => area.draw(&PathElement::new([(x, y), (x + 30, y)], colour.stroke_width(3)))?,
            Style::Broad => area.draw(&PathElement::new([(x, y), (x + 30, y)], colour.stroke_width(9)))?,
            Style::Marked => {
                area.draw(&PathElement::new([(x, y), (x + 30, y)], colour.stroke_width(2)))?;
                area.draw(&Circle::new((x + 15, y), 4, colour.filled()))?;
            }
            Style::Dots => area.draw(&Circle::new((x + 15, y), 4, colour.filled()))?,
            Style::Dashed => {
                for dash in [x, x + 11, x + 22] {
                    area.draw(&PathElement::new([(dash, y), (dash + 7, y)], colour.stroke_width(3)))?;
                }
            }
        }
        let style = (FONT, 17).into_font().color(&INK).pos(left);
        area.draw(&Text::new(series.name.clone(), (x + 38, y), style))?;
        x += 62 + (series.name.chars().count() as f64 * 17.0 * LETTER) as i32;
    }
    Ok(())
}

fn draw_panel(area: &Area, panel: &Panel) -> Drawn {
    let (width, height) = area.dim_in_pixel();
    if !panel.title.is_empty() {
        write_centred(area, &panel.title, 18, INK, (width as i32 / 2 + 30, 12))?;
    }
    let Some((xs, ys)) = extents(panel) else {
        return write_centred(area, NO_DATA, 24, FAINT, (width as i32 / 2, height as i32 / 2));
    };
    let mut chart = ChartBuilder::on(area)
        .margin_top(if panel.title.is_empty() { 8 } else { 24 })
        .margin_right(22)
        .margin_left(10)
        .margin_bottom(6)
        .x_label_area_size(46)
        .y_label_area_size(74)
        .build_cartesian_2d(xs.clone(), ys.clone())?;
    draw_axes(&mut chart, panel, digits(xs.end - xs.start), digits(ys.end - ys.start))?;
    if let Some(x) = panel.mark {
        chart.draw_series(DashedLineSeries::new(
            [(x, ys.start), (x, ys.end)],
            5,
            4,
            FAINT.stroke_width(1),
        ))?;
    }
    panel.series.iter().try_for_each(|series| draw_series(&mut chart, series))
}

fn write_centred(area: &Area, text: &str, size: i32, colour: RGBColor, at: (i32, i32)) -> Drawn {
    let style = (FONT, size).into_font().color(&colour).pos(Pos::new(HPos::Center, VPos::Center));
    Ok(area.draw(&Text::new(text.to_owned(), at, style))?)
}

fn draw_axes(chart: &mut Context, panel: &Panel, x_digits: usize, y_digits: usize) -> Drawn {
    chart
        .configure_mesh()
        .light_line_style(TRANSPARENT)
        .bold_line_style(GRID)
        .axis_style(INK)
        .x_labels(9)
        .y_labels(7)
        .x_label_formatter(&|x| format!("{x:.x_digits$}"))
        .y_label_formatter(&|y| format!("{y:.y_digits$}"))
        .label_style((FONT, 15).into_font().color(&INK))
        .axis_desc_style((FONT, 17).into_font().color(&INK))
        .x_desc(panel.x.as_str())
        .y_desc(panel.y.as_str())
        .draw()?;
    Ok(())
}

fn draw_series(chart: &mut Context, series: &Series) -> Drawn {
    let colour = rgb(series.colour);
    let points = drawn(series);
    match series.style {
        Style::Line => {
            chart.draw_series(LineSeries::new(points, colour.stroke_width(2)))?;
        }
        Style::Broad => {
            chart.draw_series(LineSeries::new(points, colour.stroke_width(8)))?;
        }
        Style::Dashed => {
            chart.draw_series(DashedLineSeries::new(points, 6, 4, colour.stroke_width(2)))?;
        }
        Style::Marked => {
            chart.draw_series(LineSeries::new(points.clone(), colour.stroke_width(2)))?;
            chart.draw_series(points.iter().map(|&point| Circle::new(point, 4, colour.filled())))?;
        }
        Style::Dots => {
            let dot = |&point| Circle::new(point, 2, colour.mix(0.6).filled());
            chart.draw_series(points.iter().map(dot))?;
        }
    }
    Ok(())
}

const fn rgb([red, green, blue]: [u8; 3]) -> RGBColor {
    RGBColor(red, green, blue)
}

/// The points that are drawn. Of more than [`MOST_POINTS`] a line keeps its ends and its peaks, and of dots one in so many stays.
fn drawn(series: &Series) -> Vec<(f64, f64)> {
    let finite = |(x, y): &(f64, f64)| x.is_finite() && y.is_finite();
    let points: Vec<_> = series.points.iter().copied().filter(finite).collect();
    if points.len() <= MOST_POINTS {
        return points;
    }
    match series.style {
        Style::Line | Style::Dashed | Style::Broad => {
            let [first, between @ .., last] = &points[..] else { return points };
            let run = between.len().div_ceil(MOST_POINTS / 2 - 1);
            let peaks = between.chunks(run).flat_map(lowest_and_highest);
            [*first].into_iter().chain(peaks).chain([*last]).collect()
        }
        Style::Marked => points,
        Style::Dots => {
            let step = points.len().div_ceil(MOST_POINTS);
            points.into_iter().step_by(step).collect()
        }
    }
}

/// Of points that lie behind each other on a line, in their order; of equal ones the first and the last.
fn lowest_and_highest(points: &[(f64, f64)]) -> impl Iterator<Item = (f64, f64)> {
    let by_y = |a: &usize, b: &usize| points[*a].1.total_cmp(&points[*b].1);
    let lowest = (0..points.len()).min_by(by_y);
    let highest = (0..points.len()).max_by(by_y);
    let mut both: Vec<_> = lowest.into_iter().chain(highest).collect();
    both.sort_unstable();
    both.dedup();
    both.into_iter().map(|at| points[at])
}

/// Extents of the axes, neither of them empty; `None` without a point.
fn extents(panel: &Panel) -> Option<(std::ops::Range<f64>, std::ops::Range<f64>)> {
    let points: Vec<_> = panel.series.iter().flat_map(drawn).collect();
    let least = points.iter().map(|point| point.0).min_by(f64::total_cmp)?;
    let most = points.iter().map(|point| point.0).max_by(f64::total_cmp)?;
    let highest = points.iter().map(|point| point.1).max_by(f64::total_cmp)?;
    let lowest = points.iter().map(|point| point.1).min_by(f64::total_cmp)?.min(0.0);
    // Marks at the ends need room.
    let marked = panel.series.iter().any(|series| matches!(series.style, Style::Marked | Style::Dots));
    let room = if marked { 0.03 * (most - least) } else { 0.0 };
    let xs = if most > least { least - room..most + room } else { least - 0.5..most + 0.5 };
    let ys = if highest > lowest { lowest..lowest + 1.06 * (highest - lowest) } else { lowest..lowest + 1.0 };
    Some((xs, ys))
}

/// Digits behind the point that tell the labels of an axis of this length apart.
fn digits(length: f64) -> usize {
    (0..9).find(|&digits| length / 7.0 * 10_f64.powi(digits) >= 0.999).unwrap_or(9) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    fn series(points: Vec<(f64, f64)>) -> Series {
        Series { name: "a < b".to_owned(), colour: [1, 2, 3], style: Style::Line, points }
    }

    fn panel(points: Vec<(f64, f64)>) -> Panel {
        let series = vec![series(points)];
        Panel { x: "x (s)".to_owned(), y: "y (m)".to_owned(), series, ..Panel::default() }
    }

    #[test]
    fn a_panel_without_a_point_says_so_and_has_no_axes() {
        for points in [vec![], vec![(f64::NAN, 1.0)]] {
            let text = svg("title", &[], &[panel(points)]);
            assert!(text.contains(NO_DATA) && !text.contains("x (s)"));
        }
    }

    #[test]
    fn one_point_and_equal_points_have_axes() {
        for points in [vec![(3.0, 0.0)], vec![(3.0, 5.0); 4], vec![(0.0, 1e-9), (1e9, 1e9)]] {
            let text = svg("title", &[], &[panel(points)]);
            assert!(text.contains("x (s)") && !text.contains("NaN") && !text.contains(NO_DATA));
        }
    }

    #[test]
    fn the_legend_is_escaped_and_stands_above() {
        let text = svg("title", &[series(vec![])], &[panel(vec![(0.0, 1.0), (1.0, 2.0)])]);
        assert!(text.contains("a &lt; b") && text.find("title") < text.find("x (s)"));
    }

    #[test]
    fn labels_have_the_digits_that_tell_them_apart() {
        assert_eq!([1000.0, 7.0, 1.0, 0.4, 0.05].map(digits), [0, 0, 1, 2, 3]);
    }

    #[test]
    fn a_long_line_keeps_its_peaks_and_many_dots_their_places() {
        let mut points: Vec<_> = (0..1600).map(|i| (f64::from(i), 1.0)).collect();
        (points[801].1, points[1101].1) = (100.0, -5.0);
        // The ends stay beside what is higher and lower in the same run.
        (points[0].1, points[1].1, points[2].1) = (2.0, 3.0, 0.5);
        (points[1599].1, points[1598].1, points[1597].1) = (2.0, 3.0, 0.5);
        let line = drawn(&series(points.clone()));
        assert!(line.len() <= MOST_POINTS && line.is_sorted_by(|a, b| a.0 < b.0), "{line:?}");
        assert!(
            [(0.0, 2.0), (801.0, 100.0), (1101.0, -5.0), (1599.0, 2.0)].iter().all(|it| line.contains(it))
        );
        let dots = Series { style: Style::Dots, ..series(points.clone()) };
        assert!(drawn(&dots).len() <= MOST_POINTS && drawn(&dots).iter().all(|dot| points.contains(dot)));
        let panel = Panel { series: vec![dots], ..Panel::default() };
        assert!(extents(&panel).unwrap().1.end < 3.5, "no room for what is not drawn");
    }

    #[test]
    fn a_short_line_is_drawn_point_by_point() {
        let points: Vec<_> = (0..800).map(|i| (f64::from(i), f64::from(i % 7))).collect();
        assert_eq!(drawn(&series(points.clone())), points);
    }
}
