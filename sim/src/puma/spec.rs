//! The settings by name.

use robot_session::spec::{ANY_TIME, Configure, FieldVisitor};
use val2_alter::{Polarity, Scale};

use super::{ArmConfig, Layout, Order, Puma};

impl Configure for Puma {
    /// Visits all fields except the incidents, which a program writes in its own way, and the transport.
    fn configure(&mut self, fields: &mut impl FieldVisitor) {
        let Self { config, arm, restart, subroutine_time, incidents: _, is_paced: _ } = self;
        config.configure(fields);
        let about = "the time until the operator restarts the program";
        fields.time("restart", ANY_TIME, about, restart);
        let about = "how long the subroutine of an exception runs";
        fields.time("subroutine_time", ANY_TIME, about, subroutine_time);
        arm.configure(fields);
    }
}

impl Configure for ArmConfig {
    fn configure(&mut self, fields: &mut impl FieldVisitor) {
        let Self { polarity, scale, layout, home } = self;
        let choices = [("tool_is_one", Polarity::ToolIsOne), ("world_is_one", Polarity::WorldIsOne)];
        fields.choice("polarity", &choices, "the polarity of mode bit 1", polarity);
        fields.group("scale", |fields| {
            let Scale { per_mm, per_degree } = scale;
            fields.real("per_mm", 0.001..=32767.0, "units", "a millimetre in the words", per_mm);
            fields.real("per_degree", 0.001..=32767.0, "units", "a degree in the words", per_degree);
        });
        fields.group("layout", |fields| {
            let Layout { order, rotation_one, per_mm } = layout;
            let choices = [
                ("columns", Order::Columns),
                ("rows", Order::Rows),
                ("position_then_columns", Order::PositionThenColumns),
                ("rotation_rows_then_position", Order::RotationRowsThenPosition),
            ];
            fields.choice("order", &choices, "the order of the twelve words of a transformation", order);
            fields.real(
                "rotation_one",
                1.0..=32767.0,
                "",
                "the word that is 1.0 in the rotation",
                rotation_one,
            );
            fields.real("per_mm", 0.001..=32767.0, "units", "a millimetre in the position", per_mm);
        });
        fields.group("home", |fields| {
            let reach = -1023.0..=1023.0;
            let about = "the arm's start position";
            for (name, value) in ["x", "y", "z"].into_iter().zip(&mut home.p) {
                fields.real(name, reach.clone(), "mm", about, value);
            }
        });
    }
}
