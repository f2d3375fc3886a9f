//! A position of a program or of a register, and its form in Modbus registers.

use fanuc_hmi_modbus::PositionRegister;
use fanuc_hmi_modbus::position::{Cartesian, Configuration};
use fanuc_ls::{AxisName, AxisUnit, Group};

use cellwire_motion::{Goal, Pose, Posture};

/// A position of the first motion group, six axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum RobotPosition {
    /// X, Y, Z in mm and W, P, R in degrees, in a user frame.
    Cartesian {
        /// X, Y, Z in mm, then W, P, R in degrees.
        xyzwpr: [f64; 6],
        /// The posture of the arm, and the turns of J4 to J6; `None` if they are not known.
        folded: Option<(Posture, [i16; 3])>,
    },
    /// The angles of J1 to J6, in degrees.
    Joints([f64; 6]),
}

impl Default for RobotPosition {
    fn default() -> Self {
        Self::Cartesian { xyzwpr: [0.0; 6], folded: None }
    }
}

impl RobotPosition {
    /// Returns the place of a group of `/POS`. `None` if it was never taught, or has other axes.
    pub fn of_group(group: &Group) -> Option<Self> {
        let value = |name: AxisName, unit: AxisUnit| {
            let axis = group.axes.iter().find(|axis| axis.name == name)?;
            axis.value.filter(|_| axis.unit == unit)
        };
        if let Some(j1) = value(AxisName::J(1), AxisUnit::Deg) {
            let mut joints = [j1; 6];
            for (number, joint) in (1..).zip(&mut joints) {
                *joint = value(AxisName::J(number), AxisUnit::Deg)?;
            }
            return Some(Self::Joints(joints));
        }
        use AxisName::{P, R, W, X, Y, Z};
        let mut xyzwpr = [0.0; 6];
        for (name, part) in [X, Y, Z, W, P, R].into_iter().zip(&mut xyzwpr) {
            let unit = if matches!(name, X | Y | Z) { AxisUnit::Mm } else { AxisUnit::Deg };
            *part = value(name, unit)?;
        }
        let folded = group.configuration.as_ref().and_then(|it| folded(&it.text));
        Some(Self::Cartesian { xyzwpr, folded })
    }

    /// Returns the goal of a motion to the position; `frame` is the user frame.
    pub fn goal(&self, frame: Pose) -> Goal {
        match self {
            Self::Joints(joints) => Goal::Joints(*joints),
            Self::Cartesian { xyzwpr, folded } => Goal::Pose(frame.then(Pose::from_xyzwpr(*xyzwpr)), *folded),
        }
    }

    /// Returns the six coordinates.
    pub fn parts(&self) -> &[f64; 6] {
        match self {
            Self::Cartesian { xyzwpr, .. } => xyzwpr,
            Self::Joints(joints) => joints,
        }
    }

    /// Returns a coordinate, counted from 1.
    pub fn element(&self, number: u32) -> Option<f64> {
        self.parts().get(usize::try_from(number).ok()?.checked_sub(1)?).copied()
    }

    /// Returns a coordinate, counted from 1, to change it.
    pub fn element_mut(&mut self, number: u32) -> Option<&mut f64> {
        let (Self::Cartesian { xyzwpr: parts, .. } | Self::Joints(parts)) = self;
        parts.get_mut(usize::try_from(number).ok()?.checked_sub(1)?)
    }

    /// Adds coordinate by coordinate, as a controller adds position registers. `None` for joints and X Y Z.
    pub fn plus(&self, other: &Self, sign: f64) -> Option<Self> {
        if core::mem::discriminant(self) != core::mem::discriminant(other) {
            return None;
        }
        let mut sum = *self;
        let (Self::Cartesian { xyzwpr: parts, .. } | Self::Joints(parts)) = &mut sum;
        parts.iter_mut().zip(other.parts()).for_each(|(part, more)| *part += sign * more);
        Some(sum)
    }

    /// Returns the 50 registers of the position.
    #[expect(clippy::cast_possible_truncation, reason = "they are of single precision")]
    pub fn register(&self) -> PositionRegister {
        let parts = self.parts().map(|part| part as f32);
        match self {
            Self::Cartesian { folded, .. } => {
                let bit = |bit: bool| i16::from(bit);
                let configuration = folded.map_or(Configuration::default(), |(posture, turns)| {
                    let Posture { flip, up, front } = posture;
                    Configuration { flip: bit(flip), left: 0, up: bit(up), front: bit(front), turns }
                });
                let cartesian = Cartesian { xyzwpr: parts, external: [0.0; 3], configuration };
                PositionRegister { cartesian: Some(cartesian), ..PositionRegister::default() }
            }
            Self::Joints(_) => {
                let [j1, j2, j3, j4, j5, j6] = parts;
                let joints = Some([j1, j2, j3, j4, j5, j6, 0.0, 0.0, 0.0]);
                PositionRegister { joints, ..PositionRegister::default() }
            }
        }
    }

    /// Returns the place in a position register of 50 words; `None` if the register is empty.
    pub fn of_register(register: &PositionRegister) -> Option<Self> {
        if let Some(Cartesian { xyzwpr, configuration, .. }) = register.cartesian {
            let Configuration { flip, up, front, turns, .. } = configuration;
            let posture = Posture { flip: flip != 0, up: up != 0, front: front != 0 };
            return Some(Self::Cartesian { xyzwpr: xyzwpr.map(f64::from), folded: Some((posture, turns)) });
        }
        let [j1, j2, j3, j4, j5, j6, ..] = register.joints?.map(f64::from);
        Some(Self::Joints([j1, j2, j3, j4, j5, j6]))
    }
}

/// Parses a configuration such as `N U T, 0, 0, 0`; `None` for any other text.
fn folded(text: &str) -> Option<(Posture, [i16; 3])> {
    let mut parts = text.split(',');
    let letters: Vec<&str> = parts.next()?.split_whitespace().collect();
    let has = |yes: &str, no: &str| {
        let found = letters.iter().find(|letter| **letter == yes || **letter == no)?;
        Some(*found == yes)
    };
    let posture = Posture { flip: has("F", "N")?, up: has("U", "D")?, front: has("T", "B")? };
    let mut turn = || parts.next().and_then(|turn| turn.trim().parse().ok()).unwrap_or(0);
    Some((posture, [turn(), turn(), turn()]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_position_is_the_same_in_its_registers() {
        let posture = Posture { flip: true, up: true, front: false };
        assert_eq!(folded("F U B, 0, -1, 2"), Some((posture, [0, -1, 2])));
        assert_eq!(folded("N D T"), Some((Posture { flip: false, up: false, front: true }, [0; 3])));
        assert_eq!(folded("nonsense"), None);
        let xyzwpr = [500.0, -1.5, 300.25, 180.0, 0.0, 45.0];
        for place in [
            RobotPosition::Cartesian { xyzwpr, folded: Some((posture, [0, -1, 2])) },
            RobotPosition::Joints([1.0, 2.0, 3.0, 4.0, 5.0, 6.0]),
        ] {
            assert_eq!(RobotPosition::of_register(&place.register()), Some(place));
        }
        assert_eq!(RobotPosition::of_register(&PositionRegister::default()), None);
        let sum = RobotPosition::Joints([1.0; 6]).plus(&RobotPosition::Joints([2.0; 6]), -1.0);
        assert_eq!(sum, Some(RobotPosition::Joints([-1.0; 6])));
        assert_eq!(RobotPosition::Joints([1.0; 6]).plus(&RobotPosition::default(), 1.0), None);
    }
}
