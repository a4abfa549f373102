//! How far the level curves of a function are off the feed directions that were asked for.

use cutter::Cutter;
use field::ScalarField;

use crate::surface::chart::Chart;
use crate::vocabulary::FeedDirection;

/// Places along each parameter that are compared.
const PLACES: usize = 41;

/// Passes that are off by more, rad, do not do what was asked.
const OFF: f64 = 5.0 * std::f64::consts::PI / 180.0;

/// The angle between the level curves of `psi` over a chart and the directions asked for there, rad: root mean square by how
/// much the direction matters at each place. `None` where nothing was asked for.
pub(crate) fn angle_off(
    chart: &Chart<'_>,
    psi: &ScalarField,
    direction: &FeedDirection,
    cutter: &Cutter,
) -> Option<f64> {
    let (mut squares, mut weights) = (0.0, 0.0);
    for [u, v] in chart.grid(PLACES) {
        let Some(p) = chart.at(u, v) else { continue };
        let [_, fu, fv] = psi.value_and_gradient(u, v);
        let along = (p.jet.dv * fu - p.jet.du * fv).try_normalize(f64::MIN_POSITIVE);
        if let (Some(along), Some((asked, matters))) = (along, p.feed(direction, cutter)) {
            let angle = along.cross(&asked).norm().atan2(along.dot(&asked).abs());
            squares += matters * angle * angle;
            weights += matters;
        }
    }
    (weights > 0.0).then(|| (squares / weights).sqrt())
}

/// What is to be said of passes that do not keep to their direction; nothing where they do.
pub(crate) fn note(off: Option<f64>) -> Option<String> {
    off.filter(|angle| *angle > OFF).map(|angle| {
        let angle = angle.to_degrees();
        format!(
            "passes are {angle:.1} degrees (root mean square) off the directions that were asked for: a greater `follow` keeps \
             closer to them, and without it they are kept to whatever the length"
        )
    })
}
