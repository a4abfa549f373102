//! How far passes are off the feed directions that were asked for.
//!
//! Enters: the contacts of all passes, each with the angle between the tangent of its pass and the direction asked for there.
//! Leaves: the mean and the greatest angle.

use std::f64::consts::FRAC_PI_2;

use cutter::Cutter;
use field::DirectionError;
use geometry::Vector3;

use crate::surface::chart::Chart;
use crate::vocabulary::{Contact, FeedDirection, OffDirection};

/// Passes that are off by more, rad, are said to be: within a degree they do what was asked.
const OFF: f64 = std::f64::consts::PI / 180.0;

/// Where a direction matters less than this share of where it matters most, none was asked for.
const LEAST_ASKED: f64 = 0.1;

impl OffDirection {
    /// Of a pass with a unit tangent `across` it on a surface of unit `normal`, from an `asked` tangent.
    pub fn new(across: &Vector3, normal: &Vector3, asked: &Vector3, matters: f64) -> Self {
        let along = across.cross(normal);
        Self { angle: asked.dot(across).abs().atan2(asked.dot(&along).abs()), matters }
    }
}

/// Compares the contacts of passes on a chart with a direction.
pub(crate) fn compare_on_chart(
    contacts: &mut [Vec<Contact>],
    chart: &Chart<'_>,
    direction: &FeedDirection,
    cutter: &Cutter,
) {
    for contact in contacts.iter_mut().flatten() {
        let place = contact.parameters.and_then(|[u, v]| chart.at(u, v));
        contact.off = place.and_then(|p| {
            let (asked, matters) = p.feed(direction, cutter)?;
            Some(OffDirection::new(&contact.across, &p.normal, &asked, matters))
        });
    }
}

/// The angles of all passes together; `None` where no direction was asked for.
pub(crate) fn measure(passes: &[Vec<Contact>]) -> Option<DirectionError> {
    let inside = |contact: &Contact| contact.off.filter(|_| contact.inside);
    let most = passes.iter().flatten().filter_map(inside).map(|off| off.matters).fold(0.0, f64::max);
    let asked = |contact: &Contact| inside(contact).filter(|off| off.matters > LEAST_ASKED * most);
    let (mut squares, mut weights) = (0.0, 0.0);
    let mut greatest: Option<DirectionError> = None;
    for pass in passes {
        for (k, contact) in pass.iter().enumerate() {
            let Some(off) = asked(contact) else { continue };
            let beside = [k.checked_sub(1).map(|k| &pass[k]), pass.get(k + 1)];
            let beside = || beside.into_iter().flatten();
            let length: f64 = beside().map(|other| 0.5 * (other.at - contact.at).norm()).sum();
            let weight = length * off.matters;
            (squares, weights) = (squares + weight * off.angle.powi(2), weights + weight);
            if greatest.is_none_or(|found| off.angle > found.max) {
                let steps = beside().filter_map(asked).map(|other| (other.angle - off.angle).abs());
                let error_bound = steps.fold(0.0, f64::max).min(FRAC_PI_2 - off.angle);
                greatest = Some(DirectionError { rms: 0.0, max: off.angle, error_bound, at: contact.at });
            }
        }
    }
    greatest.map(|found| DirectionError { rms: (squares / weights.max(f64::MIN_POSITIVE)).sqrt(), ..found })
}

/// What is to be said of passes that do not keep to their direction; nothing where they do.
pub(crate) fn note(error: &DirectionError) -> Option<String> {
    let DirectionError { rms, max, at, .. } = *error;
    (rms > OFF).then(|| {
        format!(
            "passes are {:.1} degrees (root mean square; up to {:.0} at x {:.1} y {:.1}) off the directions that were asked for: \
             a greater `follow` or `direction_weight` keeps closer to them, and on smooth surfaces more `control_points` may",
            rms.to_degrees(),
            max.to_degrees(),
            at.x,
            at.y
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::Point3;

    /// Contacts 1 mm apart along x whose directions are off by given degrees and matter so much.
    fn pass(off: &[(f64, f64)]) -> Vec<Contact> {
        let contact = |(k, &(angle, matters)): (usize, &(f64, f64))| {
            let asked = Vector3::new(angle.to_radians().cos(), -angle.to_radians().sin(), 0.0);
            Contact {
                at: Point3::new(k as f64, 0.0, 0.0),
                across: Vector3::y(),
                allowed: 1.0,
                inside: k < 4,
                parameters: None,
                off: Some(OffDirection::new(&Vector3::y(), &Vector3::z(), &asked, matters)),
            }
        };
        off.iter().enumerate().map(contact).collect()
    }

    #[test]
    fn angles_are_weighed_by_length_and_by_what_matters() {
        // The third hardly matters, the fifth is beyond the border.
        let found =
            measure(&[pass(&[(0.3, 1.0), (-0.4, 1.0), (80.0, 0.05), (0.5, 1.0), (70.0, 1.0)])]).unwrap();
        let rms = ((0.5 * 0.09 + 0.16 + 0.25) / 2.5f64).sqrt();
        assert!((found.rms.to_degrees() - rms).abs() < 1e-9, "{found:?}");
        assert!((found.max.to_degrees() - 0.5).abs() < 1e-9 && found.at.x == 3.0, "{found:?}");
        assert_eq!(found.error_bound, 0.0, "nothing asked beside it");
        assert!(note(&found).is_none());
        let found = measure(&[pass(&[(10.0, 1.0), (12.0, 1.0), (177.0, 1.0)])]).unwrap();
        assert!(
            (found.error_bound.to_degrees() - 9.0).abs() < 1e-9,
            "a direction and its opposite are the same"
        );
        assert!(note(&found).unwrap().contains("up to 12 at x 1.0 y 0.0"), "{:?}", note(&found));
        assert!(measure(&[Vec::new()]).is_none());
    }
}
