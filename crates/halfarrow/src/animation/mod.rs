//! A picture of the machine that moves: from shapes and recorded values to a scene, from a scene to a page.

mod frames;
mod mesh;
#[cfg(feature = "animation")]
mod page;
#[cfg(not(feature = "animation"))]
#[path = "absent.rs"]
mod page;
mod place;
mod print;
mod scene;

pub use mesh::Mesh;
pub use scene::{Body, Curve, Form, Link, Scene};

use halfarrow_compiler::bond_graph::{Shape, ShapeKind};
use halfarrow_trace::Trace;

use crate::error::Problem;
use crate::model::Model;

/// Frames in a second of the model's time, at most.
pub const FRAMES_PER_SECOND: f64 = 60.0;

impl Model {
    /// The variables that a picture of the machine reads: what [`scene`](Model::scene) finds in a trace. They are those of the
    /// shapes that the model and its components declare.
    ///
    /// # Errors
    /// Nothing of the model has a shape, or a file of a surface cannot be read.
    pub fn pictured(&self) -> Result<Vec<String>, Problem> {
        let pictured = self.read_by_shapes()?;
        let mut meshes = self.graph.shapes.iter().filter(|shape| shape.kind == ShapeKind::Mesh);
        meshes.try_for_each(|shape| self.mesh(shape).map(drop))?;
        Ok(pictured)
    }

    /// The same without a look at files.
    fn read_by_shapes(&self) -> Result<Vec<String>, Problem> {
        let shapes = &self.graph.shapes;
        if shapes.iter().all(|shape| matches!(shape.kind, ShapeKind::Grid | ShapeKind::Nothing)) {
            return Err(Problem::NoShapes);
        }
        Ok(shapes.iter().flat_map(Shape::values).map(|named| named.name.clone()).collect())
    }

    /// The surface of a shape, in the unit of its file.
    fn mesh(&self, shape: &Shape) -> Result<Mesh, Problem> {
        let path = shape.file.as_deref().unwrap_or_default();
        let unreadable = |why: String| Problem::Unreadable { path: path.into(), why };
        let bytes = self.source_bytes(path).map_err(|why| unreadable(why.to_string()))?;
        Mesh::of_stl(&bytes).map_err(unreadable)
    }

    /// What is seen of a run: the shapes of the model, moved as the trace says, thinned to [`FRAMES_PER_SECOND`], with the
    /// other columns of the trace as curves.
    ///
    /// ```
    /// use halfarrow::{Model, Record, Run};
    /// let text = "model Swing\nimport std.multibody\n\
    ///     World:world -> Revolute:pin(n = [0, 1, 0], q0 = 1 rad) -> FixedTranslation:rod(d = [0, 0, -1]) -> Body:bob(m = 1 kg, J = diag([1, 1, 1]))\n";
    /// let model = Model::from_text("swing.bond", text, &[])?;
    /// let run = Run { every: Some(0.1), record: Record::Also(model.pictured()?), ..Run::default() };
    /// let scene = model.scene(&model.simulate(&run, &mut |_| true)?.trace)?;
    /// assert_eq!((scene.times.len(), scene.links[0].name.as_str()), (11, "rod.link"));
    /// # Ok::<(), halfarrow::Error>(())
    /// ```
    ///
    /// # Errors
    /// Nothing has a shape, the trace lacks what a shape reads or is empty, or a file of a surface cannot be read.
    pub fn scene(&self, trace: &Trace) -> Result<Scene, Problem> {
        let pictured = self.read_by_shapes()?;
        scene::Stage::new(self, trace)?.scene(&pictured)
    }
}
