//! Distribution of scallop heights over ridge length, and its plot as SVG.

use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::plot::{Drawn, FAINT, GRID, LETTERS, Page, letters, svg};
use super::scale::{Unit, plain, round_up};
use super::table::micrometres;

/// Size of the drawing; the page shows it at half of that, since the backend rounds to whole units.
const SIZE: (u32, u32) = (1440, 560);
/// Marks along the axis, at most. More run into each other.
const TICKS: f64 = 10.0;

const BAR: RGBColor = RGBColor(0x8f, 0xb3, 0xd9);
const SUM: RGBColor = RGBColor(0x1f, 0x4e, 0x79);
const PASS: RGBColor = RGBColor(0x1b, 0x7f, 0x4b);
const FAIL: RGBColor = RGBColor(0xb3, 0x26, 0x1e);

/// Bins of the plot. More shows noise of the samples; fewer hides two kinds of ridges.
const BINS: usize = 48;
/// The plot ends at this multiple of the target at most; what is higher stands in its last bin.
const MAX_TARGETS: f64 = 4.0;

/// Ridge length by scallop height.
#[derive(Debug, Clone, PartialEq)]
pub struct Histogram {
    /// Width of a bin, mm.
    bin: f64,
    /// Share of the ridge length in each bin, from 0; the last one holds all that is higher.
    shares: Vec<f64>,
    target: f64,
    limit: f64,
}

impl Histogram {
    /// Of samples `[height, ridge length]`, mm. `None` without any ridge.
    pub fn new(samples: &[[f32; 2]], target: f64, limit: f64) -> Option<Self> {
        let usable = || {
            samples
                .iter()
                .map(|s| s.map(f64::from))
                .filter(|[h, w]| h.is_finite() && *w > 0.0 && w.is_finite())
        };
        let total: f64 = usable().map(|[_, weight]| weight).sum();
        if total <= 0.0 {
            return None;
        }
        let highest = usable().map(|[height, _]| height).fold(0.0, f64::max);
        let end = highest.clamp(1.3 * limit.max(target), MAX_TARGETS * limit.max(target));
        let bin = end / BINS as f64;
        let mut shares = vec![0.0; BINS];
        for [height, weight] in usable() {
            let k = (height / bin).max(0.0) as usize;
            shares[k.min(BINS - 1)] += weight / total;
        }
        Some(Self { bin, shares, target, limit })
    }

    /// Bars of the shares, their running sum, and lines at target and limit, as an SVG element.
    pub fn svg(&self) -> String {
        svg(SIZE, |page| self.draw(page))
    }

    fn draw(&self, page: &Page<'_>) -> Drawn {
        let end = self.bin * self.shares.len() as f64;
        let tallest = round_up(self.shares.iter().copied().fold(0.0, f64::max));
        let mut chart = ChartBuilder::on(page)
            .margin_top(44)
            .margin_right(10)
            .x_label_area_size(76)
            .y_label_area_size(110)
            .right_y_label_area_size(110)
            .build_cartesian_2d(0.0..end, 0.0..tallest)?
            .set_secondary_coord(0.0..end, 0.0..1.0);
        let unit = Unit::for_range(end);
        let step = round_up(end / TICKS);
        let shares = |full: f64| move |share: &f64| format!("{} %", plain(100.0 * share, 5.0 * full));
        chart
            .configure_mesh()
            .disable_x_mesh()
            .light_line_style(TRANSPARENT)
            .bold_line_style(GRID)
            .axis_style(FAINT)
            .label_style(letters(LETTERS))
            .x_labels(TICKS as usize)
            .x_label_formatter(&|mm| unit.text(*mm, step))
            .y_label_formatter(&shares(tallest))
            .x_desc(format!("scallop height, {}", unit.name))
            .y_desc("share of the ridges")
            .draw()?;
        chart
            .configure_secondary_axes()
            .axis_style(FAINT)
            .label_style(letters(LETTERS))
            .y_label_formatter(&shares(1.0))
            .y_desc("lower than this")
            .draw()?;
        let bars = (0..self.shares.len()).filter(|k| self.shares[*k] > 0.0);
        chart.draw_series(bars.map(|k| {
            let (from, to) = (k as f64 * self.bin, (k + 1) as f64 * self.bin);
            let mut bar = Rectangle::new([(from, 0.0), (to, self.shares[k])], BAR.filled());
            bar.set_margin(0, 0, 1, 1);
            bar
        }))?;
        let sums = self.shares.iter().scan(0.0, |sum, share| {
            *sum += share;
            Some(sum.min(1.0))
        });
        let ends = (1..).map(|k| f64::from(k) * self.bin).zip(sums);
        chart.draw_secondary_series(LineSeries::new(
            [(0.0, 0.0)].into_iter().chain(ends),
            SUM.stroke_width(4),
        ))?;
        let target = (format!("target {} ", micrometres(Some(self.target))), self.target, PASS, HPos::Right);
        let limit = (
            format!(" limit of the highest {}", micrometres(Some(self.limit))),
            self.limit,
            FAIL,
            HPos::Left,
        );
        // One line where the target is the limit.
        let both =
            (format!("target and limit {}", micrometres(Some(self.limit))), self.limit, FAIL, HPos::Center);
        let marks = if self.limit > self.target { vec![target, limit] } else { vec![both] };
        for (words, at, colour, end) in marks {
            let line = [(at, 0.0), (at, tallest)];
            chart.draw_series(DashedLineSeries::new(line, 10, 6, colour.stroke_width(3)))?;
            let (x, y) = chart.backend_coord(&(at, tallest));
            let style = letters(LETTERS).color(&colour).pos(Pos::new(end, VPos::Bottom));
            page.draw(&Text::new(words, (x, y - 6), style))?;
        }
        page.present()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_are_of_ridge_length_and_sum_to_one() {
        let samples = [[0.002, 1.0], [0.004, 3.0], [9.0, 1.0], [f32::NAN, 1.0], [0.001, 0.0]];
        let histogram = Histogram::new(&samples, 0.010, 0.0125).unwrap();
        assert!((histogram.shares.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        assert_eq!(histogram.shares[BINS - 1], 0.2, "what is far higher stands in the last bin");
        let at = (0.004f32 as f64 / histogram.bin) as usize;
        assert!((histogram.shares[at] - 0.6).abs() < 1e-12);
        assert!(histogram.svg().contains("scallop height, µm"));
        assert_eq!(Histogram::new(&[], 0.01, 0.0125), None);
    }
}
