//! Boundaries that lie beside the part altogether: no pass reaches the part within them.

use geometry::{Point2, Region};
use scene::ToolpathRequest;

use super::Session;

impl Session {
    /// What is to be said of each toolpath whose `boundary` lies off the part, with the place and the cure. An axis
    /// within it may be beside the part by the cutter's radius at most.
    pub fn boundaries_beside_part(&self) -> Vec<String> {
        self.scene.toolpaths.iter().filter_map(|request| self.boundary_beside_part(request)).collect()
    }

    fn boundary_beside_part(&self, request: &ToolpathRequest) -> Option<String> {
        let boundary = request.boundary.as_ref()?;
        let ([low, high], part) = (boundary.bounds()?, self.part.bounds());
        let radius = request.tooling.cutter.radius();
        let [west, south, east, north] =
            [part.min.x - radius, part.min.y - radius, part.max.x + radius, part.max.y + radius];
        let around = [[west, south], [east, south], [east, north], [west, north]];
        let (around, _) = Region::nested(vec![around.map(|[x, y]| Point2::new(x, y)).to_vec()]).ok()?;
        around.intersection(boundary).is_empty().then(|| {
            let span = |low: Point2, high: Point2| {
                format!("x {:.3} to {:.3} y {:.3} to {:.3}", low.x, high.x, low.y, high.y)
            };
            format!(
                "the `boundary` of the toolpath {} lies off the part, and its program will be empty: it spans {}, the \
                 part {}. Move it over the part, or delete it",
                request.name,
                span(low, high),
                span(part.min.xy(), part.max.xy())
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use crate::Session;
    use scene::Scene;

    /// Of a plane from 0 to 8 and 0 to 6 under a ball of 6 mm.
    fn told(boundary: &str) -> Vec<String> {
        let text = format!(
            "[part]\nsurface = \"plane\"\nx = [0, 8]\ny = [0, 6]\n[cutter]\nshape = \"ball\"\ndiameter = 6\n\
             [[toolpath]]\nname = \"finish\"\nstrategy = \"zigzag\"\nboundary = {boundary}\n"
        );
        Session::new(Scene::parse("plate.toml", text).unwrap()).unwrap().boundaries_beside_part()
    }

    #[test]
    fn a_boundary_off_the_part_is_told_with_its_place() {
        let said = told("[[[50, 50], [60, 50], [60, 60]]]");
        let place = "x 50.000 to 60.000 y 50.000 to 60.000, the part x 0.000 to 8.000 y 0.000 to 6.000";
        assert!(said.len() == 1 && said[0].contains("finish") && said[0].contains(place), "{said:?}");
        // Around the part, but not over it; the cutter does not reach in.
        let frame = "[[[-9, -9], [19, -9], [19, 19], [-9, 19]], [[-4, -4], [12, -4], [12, 10], [-4, 10]]]";
        assert_eq!(told(frame).len(), 1);
        for over in [
            "[[[2, 2], [4, 2], [4, 4]]]",
            "[[[10, 0], [12, 0], [12, 4]]]",
            "[[[-9, -9], [19, -9], [19, 19]]]",
        ] {
            assert!(told(over).is_empty(), "{over}");
        }
    }
}
