//! The table as a chart: time of a scan and memory against the size of the map.

use std::path::Path;

use plotters::coord::ranged1d::{AsRangedCoord, ValueFormatter};
use plotters::prelude::*;

use crate::Row;

type Drawn = Result<(), Box<dyn std::error::Error>>;
type Area<'a> = DrawingArea<SVGBackend<'a>, plotters::coord::Shift>;

/// A curve: its name, its colour, and its value in a row of the table.
type Curve<'a> = (&'a str, RGBColor, &'a dyn Fn(&Row) -> f64);

const VOXELS: &str = "dense voxels";

pub(crate) fn draw(rows: &[Row], path: &Path) -> Drawn {
    let area = SVGBackend::new(path, (1000, 420)).into_drawing_area();
    area.fill(&WHITE)?;
    let (left, right) = area.split_horizontally(500);
    let times: [Curve; 4] = [
        ("seen before, door shut", RGBColor(31, 119, 180), &|row| row.times[0].median),
        ("seen before, door open", RGBColor(110, 70, 160), &|row| row.times[1].median),
        ("new, door shut", RGBColor(214, 96, 30), &|row| row.times[2].median),
        ("new, door open", RGBColor(200, 40, 90), &|row| row.times[3].median),
    ];
    let all = rows.iter().flat_map(|row| row.times);
    let highest = all.map(|times| times.median).fold(1.0, f64::max);
    panel(&left, "a scan, median (ms)", rows, 0.0..1.5 * highest, &times)?;
    let memory: [Curve; 1] = [("resident memory", RGBColor(44, 120, 60), &|row| row.bytes / 1e6)];
    let most = rows.iter().map(|row| row.bytes / 1e6).fold(1.0, f64::max);
    panel(&right, "memory (MB)", rows, (1.0..2.0 * most).log_scale(), &memory)?;
    area.present()?;
    Ok(())
}

fn panel<Y>(area: &Area, title: &str, rows: &[Row], values: Y, curves: &[Curve]) -> Drawn
where
    Y: AsRangedCoord<Value = f64>,
    Y::CoordDescType: ValueFormatter<f64>,
{
    let voxels = |row: &Row| f64::from(row.voxels);
    let [first, last] = [rows.first(), rows.last()].map(|row| row.map_or(1.0, voxels));
    let mut chart = ChartBuilder::on(area)
        .caption(title, ("sans-serif", 20))
        .margin(12)
        .x_label_area_size(44)
        .y_label_area_size(64)
        .build_cartesian_2d((0.7 * first..1.4 * last).log_scale(), values)?;
    let power = |x: &f64| format!("{x:e}");
    chart
        .configure_mesh()
        .x_desc(VOXELS)
        .x_label_formatter(&power)
        .light_line_style(TRANSPARENT)
        .label_style(("sans-serif", 14))
        .draw()?;
    for (name, colour, value) in curves {
        let points: Vec<_> = rows.iter().map(|row| (voxels(row), value(row))).collect();
        let line = chart.draw_series(LineSeries::new(points.clone(), colour.stroke_width(2)))?;
        line.label(*name).legend(|(x, y)| PathElement::new([(x, y), (x + 20, y)], colour.stroke_width(3)));
        chart.draw_series(points.into_iter().map(|point| Circle::new(point, 4, colour.filled())))?;
    }
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::UpperLeft)
        .background_style(WHITE.mix(0.8))
        .label_font(("sans-serif", 14))
        .draw()?;
    Ok(())
}
