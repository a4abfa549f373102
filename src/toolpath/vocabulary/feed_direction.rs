//! Where the cutter is to be fed to, place by place.

use std::sync::Arc;

use crate::levels::spacing::LevelSteps;
use field::LineField;
use field::mesh::Sense;
use geometry::Point2;

/// Which parameter a pass follows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Along {
    /// u grows along a pass, v is constant.
    U,
    /// v grows along a pass, u is constant.
    V,
}

/// Which lines of a stream function passes are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Lines {
    /// Its levels, placed for the shortest passes.
    #[default]
    Levels,
    /// Its streamlines, traced by Runge–Kutta steps of fourth order from seeds: each as far from the line
    /// before as the narrowest strip along both allows.
    RungeKutta,
}

impl Lines {
    /// Its words in scenes.
    pub(crate) const WORDS: [(&str, Self); 2] = [("levels", Self::Levels), ("rk4", Self::RungeKutta)];

    /// How the lines follow one another.
    pub(crate) fn steps(self) -> LevelSteps {
        match self {
            Self::Levels => LevelSteps::Shortest,
            Self::RungeKutta => LevelSteps::Least,
        }
    }
}

/// Where the feed direction of a streamline comes from.
#[derive(Debug, Clone, PartialEq)]
pub enum FeedDirection {
    /// Along a parameter of the patch (x and y of a mesh part).
    Parameter(Along),
    /// A fixed angle from the x axis in the plan view, rad.
    Angle(f64),
    /// Across the widest strip, from the principal curvatures.
    WidestStrip,
    /// Up the slope of the surface; none on level ground.
    Steepest,
    /// Level along the surface, square to the slope; none on level ground.
    Contour,
    /// As sampled at places of the plan view, or of the parameters of each patch.
    Samples(Arc<LineField>),
    /// As sampled in a file.
    File {
        /// The file as a scene names it.
        name: String,
        /// What it holds; `None` until it is read.
        samples: Option<Arc<LineField>>,
    },
    /// From curves of the plan view; between and beyond them the smoothest field that they allow.
    Guides {
        /// Polylines of at least two different points, mm.
        curves: Arc<Vec<Vec<Point2>>>,
        /// Along or across them.
        sense: Sense,
    },
    /// From the borders of the part, of each patch where patches are planned one by one; inside, the
    /// smoothest field that they allow.
    Border(Sense),
    /// The mean of directions as lines (of their doubled angles in the tangent plane) by positive weights,
    /// each times how much its direction matters at the place.
    Blend(Vec<(FeedDirection, f64)>),
}

impl FeedDirection {
    /// What files of directions hold, in the order in which a scene names them; to be read into.
    pub fn files_mut(&mut self) -> Vec<&mut Option<Arc<LineField>>> {
        match self {
            Self::File { samples, .. } => vec![samples],
            Self::Blend(parts) => parts.iter_mut().flat_map(|(part, _)| part.files_mut()).collect(),
            _ => Vec::new(),
        }
    }
}
