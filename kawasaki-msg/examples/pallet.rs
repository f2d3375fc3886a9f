//! A PC lets a robot fill a pallet: `cargo run --features std --example pallet -- pc tcp`, and `-- robot tcp` in another
//! terminal.

pub(crate) mod ends;

use kawasaki_msg::{FieldVisitor, Text, Unfit, Work};

/// Move to these joint values with this tool, at this speed.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct PalletMove {
    /// In thousandths of a degree.
    pub(crate) joints: [i32; 6],
    /// The tool of the gripper.
    pub(crate) tool: Text<8>,
    /// In per cent.
    pub(crate) speed: u8,
}

impl Work for PalletMove {
    type Ranges = ();

    fn fields<F: FieldVisitor>(&mut self, (): &(), fields: &mut F) -> Result<(), Unfit> {
        for (joint, name) in self.joints.iter_mut().zip(["j1", "j2", "j3", "j4", "j5", "j6"]) {
            fields.decimal(name, joint, 3, -360_000..=360_000)?;
        }
        fields.text("tool", &mut self.tool, 1..=8)?;
        fields.whole("speed", &mut self.speed, 1..=100)
    }
}

fn main() -> Result<(), Box<dyn core::error::Error>> {
    ends::main(&pallet())
}

/// 4 layers of 5 by 5 boxes: three motions for each box: above it, down with the box, up without it.
pub(crate) fn pallet() -> Vec<PalletMove> {
    let tool = |name| Text::new(name).unwrap_or_default();
    let moves = (0..100).flat_map(|place| {
        let (row, column, layer) = (place / 5 % 5, place % 5, place / 25);
        let at =
            |height: i32| [row * 7_500 - 15_000, 45_250 + column * 3_125, -height, 0, 90_000 - height, 500];
        [(40_000, "closed", 100), (60_000 - layer * 5_000, "closed", 20), (40_000, "open", 50)]
            .map(|(height, name, speed)| PalletMove { joints: at(height), tool: tool(name), speed })
    });
    moves.collect()
}
