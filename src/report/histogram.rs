//! Distribution of scallop heights over ridge length, and its plot as SVG.

use maud::{Markup, html};

use super::scale::{Unit, round_up, ticks};

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

    /// Bars of the shares, their running sum, and lines at target and limit.
    pub fn svg(&self) -> Markup {
        const WIDTH: f64 = 660.0;
        const HEIGHT: f64 = 260.0;
        const LEFT: f64 = 52.0;
        const RIGHT: f64 = 52.0;
        const TOP: f64 = 26.0;
        const BOTTOM: f64 = 46.0;
        let (plot_width, plot_height) = (WIDTH - LEFT - RIGHT, HEIGHT - TOP - BOTTOM);
        let end = self.bin * self.shares.len() as f64;
        let x = |mm: f64| LEFT + mm / end * plot_width;
        let tallest = round_up(self.shares.iter().copied().fold(0.0, f64::max) * 100.0) / 100.0;
        let y = |share: f64, full: f64| TOP + (1.0 - share / full) * plot_height;
        let unit = Unit::for_range(end);
        let marks = ticks(0.0, end, 9.0);
        let step = marks.get(1).copied().unwrap_or(end);
        let mut sum = 0.0;
        let mut line = format!("M{:.2} {:.2}", x(0.0), y(0.0, 1.0));
        for (k, share) in self.shares.iter().enumerate() {
            sum += share;
            line += &format!(" L{:.2} {:.2}", x((k + 1) as f64 * self.bin), y(sum.min(1.0), 1.0));
        }
        html! {
            svg viewBox=(format!("0 0 {WIDTH} {HEIGHT}")) width=(WIDTH) height=(HEIGHT) role="img"
                aria-label="Distribution of scallop heights" {
                @for part in [0.0, 0.25, 0.5, 0.75, 1.0] {
                    line x1=(LEFT) x2=(WIDTH - RIGHT) y1=(y(part, 1.0)) y2=(y(part, 1.0)) class="grid" {}
                    text x=(WIDTH - RIGHT + 6.0) y=(y(part, 1.0) + 4.0) { (format!("{:.0} %", part * 100.0)) }
                    text x=(LEFT - 6.0) y=(y(part, 1.0) + 4.0) text-anchor="end" { (format!("{:.3}", part * tallest * 100.0).trim_end_matches('0').trim_end_matches('.')) " %" }
                }
                @for (k, share) in self.shares.iter().enumerate() {
                    @if *share > 0.0 {
                        rect x=(format!("{:.2}", x(k as f64 * self.bin) + 0.5)) width=(format!("{:.2}", plot_width / self.shares.len() as f64 - 1.0))
                            y=(format!("{:.2}", y(*share, tallest))) height=(format!("{:.2}", share / tallest * plot_height)) class="bar" {}
                    }
                }
                path d=(line) class="sum" {}
                @for mark in &marks {
                    line x1=(x(*mark)) x2=(x(*mark)) y1=(TOP + plot_height) y2=(TOP + plot_height + 5.0) class="axis" {}
                    text x=(x(*mark)) y=(TOP + plot_height + 18.0) text-anchor="middle" { (unit.text(*mark, step)) }
                }
                line x1=(LEFT) x2=(WIDTH - RIGHT) y1=(TOP + plot_height) y2=(TOP + plot_height) class="axis" {}
                (self.mark(x(self.target), "target", "target", TOP, plot_height, "end"))
                (self.mark(x(self.limit), "limit", "limit of the highest", TOP, plot_height, "start"))
                text x=(LEFT + 0.5 * plot_width) y=(HEIGHT - 8.0) text-anchor="middle" { "scallop height, " (unit.name) }
            }
        }
    }

    fn mark(&self, x: f64, class: &str, words: &str, top: f64, height: f64, anchor: &str) -> Markup {
        html! {
            line x1=(x) x2=(x) y1=(top - 6.0) y2=(top + height) class=(class) {}
            text x=(x) y=(top - 10.0) text-anchor=(anchor) class=(class) { (words) }
        }
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
        assert!(histogram.svg().into_string().contains("scallop height, µm"));
        assert_eq!(Histogram::new(&[], 0.01, 0.0125), None);
    }
}
