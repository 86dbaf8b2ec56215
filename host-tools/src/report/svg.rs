//! Plots as inline SVG.

use plotters::coord::Shift;
use plotters::prelude::*;

use super::evidence::Panel;
use super::{Distances, Report};

/// Why a plot could not be drawn.
pub(super) type Failure = Box<dyn std::error::Error>;

type Canvas<'a> = DrawingArea<SVGBackend<'a>, Shift>;

/// One colour a model, the same in every plot.
pub(super) const NOMINAL: RGBColor = RGBColor(150, 150, 150);
pub(super) const GEOMETRIC: RGBColor = RGBColor(66, 120, 190);
pub(super) const COMPLETE: RGBColor = RGBColor(218, 112, 44);

/// One colour an axis.
pub(super) const AXES: [RGBColor; 3] = [
    RGBColor(200, 60, 60),
    RGBColor(50, 140, 70),
    RGBColor(60, 90, 200),
];

/// Points in one panel at most: beyond, every k-th row is drawn.
const POINTS: usize = 800;

const FONT: (&str, u32) = ("sans-serif", 13);

fn draw(
    size: (u32, u32),
    paint: impl FnOnce(&Canvas<'_>) -> Result<(), Failure>,
) -> Result<String, Failure> {
    let mut svg = String::new();
    {
        let canvas = SVGBackend::with_string(&mut svg, size).into_drawing_area();
        paint(&canvas)?;
        canvas.present()?;
    }
    Ok(svg)
}

/// The models that a plot shows: name, colour.
pub(super) fn models(effects: bool) -> Vec<(&'static str, RGBColor)> {
    let mut models = vec![
        ("as drawn, aligned", NOMINAL),
        ("geometry identified", GEOMETRIC),
    ];
    if effects {
        models.push(("geometry and effects", COMPLETE));
    }
    models
}

/// Rms, mean and largest error of the held-back rows by model, mm.
pub(super) fn bars(report: &Report) -> Result<String, Failure> {
    let e = &report.summary.error_mm;
    let mut spreads = vec![e.nominal, e.geometric];
    if !report.summary.effects.is_empty() {
        spreads.push(e.complete.spread);
    }
    let top = spreads.iter().fold(0.0_f64, |top, s| top.max(s.max)) * 1.15;
    let models = models(spreads.len() > 2);
    let groups = ["rms", "mean", "largest"];
    draw((430, 280), |canvas| {
        let mut chart = ChartBuilder::on(canvas)
            .margin(8)
            .x_label_area_size(26)
            .y_label_area_size(52)
            .build_cartesian_2d(0.0..3.0, 0.0..top.max(1e-9))?;
        chart
            .configure_mesh()
            .disable_x_mesh()
            .light_line_style(TRANSPARENT)
            .bold_line_style(BLACK.mix(0.12))
            .x_labels(0)
            .y_labels(6)
            .y_label_formatter(&|y| super::figures::drawn(*y))
            .y_desc("mm")
            .label_style(FONT)
            .draw()?;
        let width = 0.8 / models.len() as f64;
        for (g, name) in groups.iter().enumerate() {
            let left = g as f64 + 0.1;
            for (m, (spread, (_, colour))) in spreads.iter().zip(&models).enumerate() {
                let value = match g {
                    0 => spread.rms,
                    1 => spread.mean,
                    _ => spread.max,
                };
                let x = left + width * m as f64;
                chart.draw_series([Rectangle::new(
                    [(x, 0.0), (x + 0.92 * width, value)],
                    colour.filled(),
                )])?;
                chart.draw_series([Text::new(
                    super::figures::significant(value),
                    (x + 0.02, value + 0.055 * top),
                    ("sans-serif", 12),
                )])?;
            }
            let (x, y) = chart.backend_coord(&(g as f64 + 0.35, 0.0));
            canvas.draw(&Text::new(*name, (x, y + 8), FONT))?;
        }
        Ok(())
    })
}

/// Share of the held-back points by error and model.
pub(super) fn histogram(report: &Report) -> Result<String, Failure> {
    const BINS: usize = 30;
    let Distances {
        nominal,
        geometric,
        complete,
    } = &report.distances_mm;
    let mut sets = vec![nominal, geometric];
    if !report.summary.effects.is_empty() {
        sets.push(complete);
    }
    let models = models(sets.len() > 2);
    let largest = sets
        .iter()
        .flat_map(|s| s.iter())
        .fold(0.0_f64, |m, &x| m.max(x));
    let width = (largest * 1.02).max(1e-9) / BINS as f64;
    let shares: Vec<Vec<f64>> = sets
        .iter()
        .map(|set| {
            let mut counts = vec![0.0; BINS];
            for x in set.iter() {
                let bin = (x / width) as usize;
                if let Some(count) = counts.get_mut(bin.min(BINS - 1)) {
                    *count += 100.0 / set.len().max(1) as f64;
                }
            }
            counts
        })
        .collect();
    let top = shares.iter().flatten().fold(0.0_f64, |m, &x| m.max(x)) * 1.08;
    draw((430, 280), |canvas| {
        let mut chart = ChartBuilder::on(canvas)
            .margin(8)
            .x_label_area_size(40)
            .y_label_area_size(52)
            .build_cartesian_2d(0.0..width * BINS as f64, 0.0..top.max(1e-9))?;
        chart
            .configure_mesh()
            .disable_x_mesh()
            .light_line_style(TRANSPARENT)
            .bold_line_style(BLACK.mix(0.12))
            .x_labels(7)
            .y_labels(6)
            .x_label_formatter(&|x| super::figures::drawn(*x))
            .x_desc("error, mm")
            .y_desc("% of the points")
            .label_style(FONT)
            .draw()?;
        for (counts, (_, colour)) in shares.iter().zip(&models) {
            let mut outline = vec![(0.0, 0.0)];
            for (i, share) in counts.iter().enumerate() {
                outline.push((i as f64 * width, *share));
                outline.push(((i + 1) as f64 * width, *share));
            }
            outline.push((BINS as f64 * width, 0.0));
            chart.draw_series([Polygon::new(outline.clone(), colour.mix(0.18).filled())])?;
            chart.draw_series([PathElement::new(outline, colour.stroke_width(2))])?;
        }
        Ok(())
    })
}

/// What the final model leaves of the held-back rows, against the joint `joint` (from 0).
pub(super) fn against_joint(report: &Report, joint: usize) -> Result<String, Failure> {
    let step = report.rows.len().div_ceil(POINTS).max(1);
    let rows: Vec<_> = report.rows.iter().step_by(step).collect();
    let of = |row: &super::Row| row.q.get(joint).copied().unwrap_or(0.0);
    let (mut low, mut high) = rows.iter().fold((f64::MAX, f64::MIN), |(low, high), row| {
        (low.min(of(row)), high.max(of(row)))
    });
    if high - low < 1e-9 {
        (low, high) = (low - 1.0, high + 1.0);
    }
    let edge = 0.03 * (high - low);
    let reach = rows
        .iter()
        .flat_map(|row| &row.residual_mm)
        .fold(1e-9_f64, |m, x| m.max(x.abs()))
        * 1.05;
    let unit = report.joint_units.get(joint).copied().unwrap_or("");
    draw((290, 210), |canvas| {
        let mut chart = ChartBuilder::on(canvas)
            .margin(6)
            .x_label_area_size(36)
            .y_label_area_size(48)
            .build_cartesian_2d(low - edge..high + edge, -reach..reach)?;
        chart
            .configure_mesh()
            .light_line_style(TRANSPARENT)
            .bold_line_style(BLACK.mix(0.1))
            .x_labels(5)
            .y_labels(5)
            .x_label_formatter(&|x| super::figures::drawn(*x))
            .y_label_formatter(&|y| super::figures::drawn(*y))
            .x_desc(format!("joint {}, {unit}", joint + 1))
            .y_desc("mm")
            .label_style(("sans-serif", 12))
            .draw()?;
        for (axis, colour) in AXES.iter().enumerate() {
            chart.draw_series(rows.iter().filter_map(|row| {
                let y = *row.residual_mm.get(axis)?;
                Some(Circle::new((of(row), y), 2, colour.mix(0.55).filled()))
            }))?;
        }
        Ok(())
    })
}

/// Without the effect and with it.
pub(super) fn before_and_after() -> [(&'static str, RGBColor); 2] {
    [("without it", GEOMETRIC), ("with it", COMPLETE)]
}

/// Residual of the held-back rows against what an effect depends on, without and with it.
pub(super) fn against_covariate(panel: &Panel) -> Result<String, Failure> {
    let step = panel.points.len().div_ceil(POINTS).max(1);
    let points: Vec<&[f64; 3]> = panel.points.iter().step_by(step).collect();
    let (mut low, mut high) = points
        .iter()
        .fold((f64::MAX, f64::MIN), |(low, high), [x, ..]| {
            (low.min(*x), high.max(*x))
        });
    if high - low < 1e-9 {
        (low, high) = (low - 1.0, high + 1.0);
    }
    let edge = 0.04 * (high - low);
    let reach = points.iter().fold(1e-9_f64, |m, [_, before, after]| {
        m.max(before.abs()).max(after.abs())
    }) * 1.05;
    draw((430, 260), |canvas| {
        let mut chart = ChartBuilder::on(canvas)
            .margin(8)
            .x_label_area_size(40)
            .y_label_area_size(64)
            .build_cartesian_2d(low - edge..high + edge, -reach..reach)?;
        chart
            .configure_mesh()
            .light_line_style(TRANSPARENT)
            .bold_line_style(BLACK.mix(0.1))
            .x_labels(6)
            .y_labels(6)
            .x_label_formatter(&|x| super::figures::drawn(*x))
            .y_label_formatter(&|y| super::figures::drawn(*y))
            .x_desc(&panel.x)
            .y_desc(&panel.y)
            .label_style(FONT)
            .draw()?;
        for (series, (_, colour)) in before_and_after().iter().enumerate() {
            chart.draw_series(
                points
                    .iter()
                    .map(|p| Circle::new((p[0], p[1 + series]), 2, colour.mix(0.55).filled())),
            )?;
        }
        Ok(())
    })
}

/// Share of a joint's squared error that each order takes, in percent.
pub(super) fn periodogram(lines: &[[f64; 2]], joint: &str) -> Result<String, Failure> {
    let top = lines.iter().fold(1.0_f64, |m, [_, share]| m.max(*share)) * 1.08;
    let end = lines.last().map_or(1.0, |[order, _]| *order);
    draw((430, 260), |canvas| {
        let mut chart = ChartBuilder::on(canvas)
            .margin(8)
            .x_label_area_size(40)
            .y_label_area_size(52)
            .build_cartesian_2d(0.0..end, 0.0..top)?;
        chart
            .configure_mesh()
            .light_line_style(TRANSPARENT)
            .bold_line_style(BLACK.mix(0.1))
            .x_labels(8)
            .y_labels(6)
            .x_label_formatter(&|x| super::figures::drawn(*x))
            .y_label_formatter(&|y| super::figures::drawn(*y))
            .x_desc(format!("periods a turn of {joint}"))
            .y_desc("% of its squared error")
            .label_style(FONT)
            .draw()?;
        let line: Vec<(f64, f64)> = lines.iter().map(|[x, y]| (*x, *y)).collect();
        chart.draw_series([PathElement::new(line, GEOMETRIC.stroke_width(2))])?;
        Ok(())
    })
}
